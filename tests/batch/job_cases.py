"""Changes to the least job: those that keep it valid, and those that break it, with the place that the
program must name and whether the JSON Schema can tell as well."""


def put(**members):
    return lambda job: job.update(members)


def drop(key):
    return lambda job: job.pop(key)


def cameras(*entries):
    return put(cameras=list(entries))


ROWS = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]
COLUMNS = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 3, 1]
LENS = {"fx": 500, "fy": 500, "cx": 320, "cy": 240, "width": 640, "height": 480}

VALID = [
    ("least", lambda job: None),
    ("scenes as objects", put(scenes=[{"path": "a.gltf", "name": "n", "scene": 0}, "builtin:paper"])),
    ("no cameras", drop("cameras")),
    ("all", put(cameras="all")),
    ("a list of all, names and indices", put(cameras=["all", "Camera", 0, "path.json"],
                                              output="out/{scene_index}_{camera_index:03}.exr")),
    ("rows", cameras({"matrices": [ROWS, ROWS[:3]], "fov": 40})),
    ("columns", cameras({"matrices": [COLUMNS], "intrinsics": LENS, "convention": "opencv",
                         "pose": "world_to_camera", "names": ["x"], "name": "y"})),
    ("turntable", cameras({"turntable": {"n": 3, "elevation": -90, "start": 45, "fov": 30,
                                         "distance": 4, "target": [0, 1, 2], "name": "t"}})),
    ("hemisphere", cameras({"hemisphere": {"n": 3, "seed": 4294967295}})),
    ("nerfstudio", cameras({"nerfstudio": "transforms.json"})),
    ("one frame", put(frames=12)),
    ("frames", put(frames="1-100:5, 200 ,3-3", fps=29.97)),
    ("animation by name", put(frames=0, animation="none")),
    ("animation by index", put(frames=0, animation=0)),
    ("motion of frames", put(frames="0-1", aovs=["Z", "motion"])),
    ("variant by name", put(variant="red")),
    ("variants of scenes", put(variant=0, scenes=[{"path": "a.gltf", "variant": "red"}, "b.gltf"])),
    ("whole numbers written as decimals", put(size=[64.0, 48.0])),
    ("several outputs", put(output=["out/{view}.exr", {"path": "out/{view}_{aov}.png",
                                                       "aovs": ["mask", "Z"]}])),
    ("everything else", put(device="cuda:1", spp=4, seed=1, sky=[0, 0.5, 1], background="transparent",
                            cull="none", alpha="ignore", depth_scale=100, missing_images="warn",
                            compression="piz", objects=True, masks="coco")),
]

# Name, change, place, whether the schema rejects it too.
INVALID = [
    ("version", put(version=2), "/version", True),
    ("no version", drop("version"), "", True),
    ("no size", drop("size"), "", True),
    ("unknown key", put(colour=1), "/colour", True),
    ("key with a slash", lambda job: job.update({"a/b~": 1}), "/a~1b~0", True),
    ("no scene", put(scenes=[]), "/scenes", True),
    ("scene of another type", put(scenes=[3]), "/scenes/0", True),
    ("scene without path", put(scenes=["a.gltf", {"name": "x"}]), "/scenes/1", True),
    ("unknown key of a scene", put(scenes=[{"path": "a.gltf", "nam": "x"}]), "/scenes/0/nam", True),
    ("control character", put(scenes=["a\nb"]), "/scenes/0", True),
    ("no cameras in the list", put(cameras=[]), "/cameras", True),
    ("camera of another type", cameras(True), "/cameras/0", True),
    ("unknown camera object", cameras({"spiral": {"n": 1}}), "/cameras/0", True),
    ("turntable without n", cameras({"turntable": {"elevation": 1}}), "/cameras/0/turntable", True),
    ("turntable of none", cameras({"turntable": {"n": 0}}), "/cameras/0/turntable/n", True),
    ("turntable n as text", cameras({"turntable": {"n": "3"}}), "/cameras/0/turntable/n", True),
    ("elevation", cameras({"turntable": {"n": 1, "elevation": 91}}),
     "/cameras/0/turntable/elevation", True),
    ("seed of a turntable", cameras({"turntable": {"n": 1, "seed": 1}}),
     "/cameras/0/turntable/seed", True),
    ("negative seed", cameras({"hemisphere": {"n": 1, "seed": -1}}), "/cameras/0/hemisphere/seed", True),
    ("fov", cameras({"hemisphere": {"n": 1, "fov": 180}}), "/cameras/0/hemisphere/fov", True),
    ("matrix of 15", cameras({"matrices": [COLUMNS[:15]], "fov": 40}), "/cameras/0/matrices/0", True),
    ("row of 3", cameras({"matrices": [[[1, 0, 0]] * 3], "fov": 40}), "/cameras/0/matrices/0/0", True),
    ("last row", cameras({"matrices": [ROWS[:3] + [[0, 0, 0, 2]]], "fov": 40}),
     "/cameras/0/matrices/0", False),
    ("zero column", cameras({"matrices": [[[0, 0, 0, 0]] * 3], "fov": 40}), "/cameras/0/matrices/0",
     False),
    ("no lens", cameras({"matrices": [ROWS]}), "/cameras/0", True),
    ("two lenses", cameras({"matrices": [ROWS], "fov": 40, "intrinsics": LENS}), "/cameras/0", True),
    ("intrinsics without size", cameras({"matrices": [ROWS], "intrinsics": {"fx": 1}}),
     "/cameras/0/intrinsics", True),
    ("convention", cameras({"matrices": [ROWS], "fov": 4, "convention": "opengles"}),
     "/cameras/0/convention", True),
    ("too few names", cameras({"matrices": [ROWS, ROWS], "fov": 4, "names": ["a"]}),
     "/cameras/0/names", False),
    ("frames backwards", put(frames="5-1"), "/frames", False),
    ("frames by step 0", put(frames="1-5:0"), "/frames", True),
    ("frames empty", put(frames=""), "/frames", True),
    ("frames with a dangling comma", put(frames="1,"), "/frames", True),
    ("frames negative", put(frames=-1), "/frames", True),
    ("frames a fraction", put(frames=1.5), "/frames", True),
    ("frames beyond the limit of views", put(frames="0-99999999"), "/frames", False),
    ("variant", put(variant=""), "/variant", True),
    ("variant as a list", put(scenes=[{"path": "a.gltf", "variant": [1]}]), "/scenes/0/variant", True),
    ("variant below 0", put(variant=-1), "/variant", True),
    ("fps", put(fps=0), "/fps", True),
    ("size of three", put(size=[1, 2, 3]), "/size", True),
    ("size zero", put(size=[0, 2]), "/size/0", True),
    ("size beyond the limit", put(size=[100000, 100000]), "/size", False),
    ("no plane", put(aovs=[]), "/aovs", True),
    ("unknown plane", put(aovs=["Z", "depths"]), "/aovs/1", False),
    ("two planes in a name", put(aovs=["Z,mask"]), "/aovs/0", True),
    ("unknown field", put(output="out/{scen}.exr"), "/output", False),
    ("open brace", put(output="out/{scene.exr"), "/output", False),
    ("closing brace", put(output="out/scene}.exr"), "/output", False),
    ("width of a name", put(output="out/{scene:04}.exr"), "/output", False),
    ("bad width", put(output="out/{frame:4d}.exr"), "/output", False),
    ("extension", put(output="out/{camera}.bmp"), "/output", False),
    ("planes without a file", put(output="out/{camera}.png"), "/output", False),
    ("plane of an output that is not rendered", put(output=[{"path": "o/{view}.exr", "aovs": ["uv"]}]),
     "/output/0/aovs/0", False),
    ("the same path", put(output="out/a.exr"), "/output", False),
    ("the same path twice", put(output=["out/{camera}.exr", "out/./{camera}.exr"]), "/output", False),
    ("names that become the same", put(scenes=[{"path": "a.gltf", "name": "x y"},
                                               {"path": "a.gltf", "name": "x_y"}]), "/output", False),
    ("device", put(device="gpu"), "/device", True),
    ("spp", put(spp=0), "/spp", True),
    ("sky", put(sky=[1, 2]), "/sky", True),
    ("dark sky", put(sky=[1, 2, -1]), "/sky/2", True),
    ("background", put(background="black"), "/background", True),
    ("compression", put(compression="dwaa"), "/compression", True),
    ("objects without ids", put(objects=True, aovs=["Z"]), "/objects", False),
    ("masks without ids", put(masks="coco", aovs=["Z"]), "/masks", False),
    ("objects as a number", put(objects=1), "/objects", True),
]
