# Turns a Blender file into what octrace renders: NAME.glb (meshes with their modifiers, materials,
# cameras, lights, animation) and NAME.job.json, a batch job with every camera, the frame range and
# the render's size. Runs inside Blender (3.4 or later) and leaves the .blend as it is.
#
#   blender -b FILE.blend -noaudio --python-exit-code 3 -P export_scene.py -- OUTPUT_FOLDER
#       [--name NAME] [--aovs beauty,Z,mask,object_id] [--frames 1-120]
#
# Then: octrace batch OUTPUT_FOLDER/NAME.job.json
import argparse
import json
import math
import os
import sys

import bpy
import numpy

if not hasattr(numpy, "bool"):
    numpy.bool = bool  # add-ons of Blender 3.4 ask for a name that NumPy 1.24 removed


def parse_arguments():
    own = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else []
    parser = argparse.ArgumentParser(prog="export_scene.py")
    parser.add_argument("folder", help="folder to write to; made where missing")
    parser.add_argument("--name", help="of the files [the .blend's]")
    parser.add_argument("--aovs", default="beauty,Z,mask,object_id")
    parser.add_argument("--frames", help="as in 1-100:5,200 [the scene's range if anything moves]")
    return parser.parse_args(own)


def warn(message):
    print("octrace: warning: " + message, flush=True)


def cameras_of(scene):
    """Camera objects that glTF has a type for, in Blender's order."""
    found = []
    for item in scene.objects:
        if item.type != "CAMERA":
            continue
        if item.data.type not in ("PERSP", "ORTHO"):
            warn("%s: glTF has no %s camera; left out" % (item.name, item.data.type))
            continue
        found.append(item)
    return found


def settle_camera(scene, item):
    """States a camera by its vertical extent, the only one that glTF and octrace look at. What
    Blender means depends on the sensor's fit and the render's aspect, and its exporter guesses."""
    if item.data.users > 1:
        item.data = item.data.copy()
    data = item.data
    frame = data.view_frame(scene=scene)
    top = max(corner.y for corner in frame)
    bottom = min(corner.y for corner in frame)
    centre_x = sum(corner.x for corner in frame) / 4
    if abs(centre_x) > 1e-6 * (top - bottom) or abs(top + bottom) > 1e-6 * (top - bottom):
        warn("%s: glTF has no camera shift; left out" % item.name)
        data.shift_x = data.shift_y = 0.0
        frame = data.view_frame(scene=scene)
        top = max(corner.y for corner in frame)
        bottom = min(corner.y for corner in frame)
    render = scene.render
    if render.pixel_aspect_x != render.pixel_aspect_y:
        warn("pixels that are not square are rendered as squares")
    if data.type == "ORTHO":
        width = render.resolution_x * render.pixel_aspect_x
        height = render.resolution_y * render.pixel_aspect_y
        data.ortho_scale = (top - bottom) * max(width, height) / height
    else:
        depth = -frame[0].z
        data.sensor_fit = "VERTICAL"
        data.lens_unit = "FOV"
        data.angle = 2.0 * math.atan(0.5 * (top - bottom) / depth)


def anything_moves():
    """Whether any object, bone, shape or camera has animation that glTF can hold."""
    blocks = list(bpy.data.objects) + list(bpy.data.shape_keys) + list(bpy.data.cameras)
    for block in blocks:
        data = block.animation_data
        if data and (data.action or data.nla_tracks or data.drivers):
            return True
    return any(item.constraints for item in bpy.data.objects)


def export_glb(scene, path, moving):
    # Shape keys are lost where modifiers are applied: whoever has them keeps his modifiers out.
    shaped = any(mesh.shape_keys for mesh in bpy.data.meshes)
    if shaped and any(item.type == "MESH" and any(m.type != "ARMATURE" for m in item.modifiers)
                      for item in scene.objects):
        warn("the scene has shape keys: modifiers other than armatures are left out")
    bpy.ops.export_scene.gltf(
        filepath=path, export_format="GLB", use_active_scene=True, use_renderable=True,
        export_cameras=True, export_lights=True, export_yup=True, export_apply=not shaped,
        export_texcoords=True, export_normals=True, export_colors=True, export_materials="EXPORT",
        export_skins=True, export_morph=True,
        export_animations=moving, export_frame_range=True, export_force_sampling=True,
        # One animation of everything that moves, as a render shows it.
        export_nla_strips=False)
    if not os.path.exists(path) or os.path.getsize(path) == 0:
        raise RuntimeError("Blender wrote no " + path)


def glb_json(path):
    with open(path, "rb") as file:
        data = file.read()
    length = int.from_bytes(data[12:16], "little")
    return json.loads(data[20:20 + length])


def exported_cameras(path):
    """Names of the nodes that carry cameras: what octrace knows them by."""
    document = glb_json(path)
    return [node.get("name", "") for node in document.get("nodes", []) if "camera" in node]


def write_whole(path, text):
    temporary = "%s.%d.tmp" % (path, os.getpid())
    with open(temporary, "w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)


def main():
    arguments = parse_arguments()
    scene = bpy.context.scene
    name = arguments.name or os.path.splitext(os.path.basename(bpy.data.filepath))[0] or "scene"
    os.makedirs(arguments.folder, exist_ok=True)
    base = os.path.join(os.path.abspath(arguments.folder), name)
    for old in (base + ".glb", base + ".job.json"):
        if os.path.lexists(old):
            os.remove(old)

    for item in cameras_of(scene):
        settle_camera(scene, item)
    moving = anything_moves()
    temporary = "%s.%d.glb" % (base, os.getpid())
    try:
        export_glb(scene, temporary, moving)
        os.replace(temporary, base + ".glb")
    finally:
        if os.path.exists(temporary):
            os.remove(temporary)

    cameras = exported_cameras(base + ".glb")
    if not cameras:
        warn("the scene has no camera: octrace frames its bounds")
    percentage = scene.render.resolution_percentage / 100.0
    job = {"version": 1, "scenes": [name + ".glb"]}
    if cameras:
        job["cameras"] = cameras
    frames = arguments.frames
    if frames is None and moving:
        frames = "%d-%d" % (scene.frame_start, scene.frame_end)
        if scene.frame_step > 1:
            frames += ":%d" % scene.frame_step
    if frames:
        job["frames"] = frames
        # The exporter turns frames into seconds by this, whatever fps_base says.
        job["fps"] = scene.render.fps
    job["size"] = [max(1, int(scene.render.resolution_x * percentage)),
                   max(1, int(scene.render.resolution_y * percentage))]
    job["aovs"] = [aov for aov in arguments.aovs.split(",") if aov]
    job["output"] = "out/{scene}_{camera}_{frame:04}.exr"
    write_whole(base + ".job.json", json.dumps(job, indent=2) + "\n")
    print("octrace: wrote %s.glb and %s.job.json" % (base, base), flush=True)


main()
