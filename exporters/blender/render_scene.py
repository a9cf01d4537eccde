# Renders glTF files inside Blender (3.4 or later) so that every pixel is one ray through its centre:
# mask, planar depth, object ids, normals and positions as a multilayer EXR. Every choice below that
# looks odd undoes one of Blender's defaults; each was found by comparing images.
#
#   blender -b --factory-startup -noaudio --python-exit-code 3 -P THIS_FILE
#
# JOB comes before this text: {"scenes": [{"file", "gltf_scene", "seconds" (null: at rest), "animation"
# (a name, else an index; empty: the first), "cull", "alpha", "views": [{"type",
# "matrix" (camera to world as glTF has it, orthonormal, by columns), "top", "bottom", "left", "right"
# (borders of the image in the plane at depth 1), "width", "height", "clip_start", "clip_end",
# "output"}]}]}.
import math
import os
import sys
import tempfile
import traceback

import bpy
import numpy
from mathutils import Matrix

if not hasattr(numpy, "bool"):
    numpy.bool = bool  # the importer of Blender 3.4 asks for a name that NumPy 1.24 removed

FOLDER = os.path.dirname(os.path.abspath(__file__))

# glTF's axes (y up) to Blender's (z up): (x, y, z) -> (x, -z, y).
TO_BLENDER = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))

MAX_OBJECT = 32767  # pass_index has 15 bits


def absolute(path):
    return os.path.join(FOLDER, path)


def import_gltf(path, animated, choice):
    """Imports with Blender's own importer. At rest, in the pose of the nodes: no animation is created
    at all, so none can move anything. Returns the importer's state, which knows glTF's indices."""
    from io_scene_gltf2.blender.imp import gltf2_blender_scene
    from io_scene_gltf2.blender.imp.gltf2_blender_animation import BlenderAnimation

    states = []
    keep = gltf2_blender_scene.BlenderScene.create_animations

    def create(gltf):
        states.append(gltf)
        if not animated:
            return
        # The importer ends by playing the first animation. Another one is played instead of that and
        # not after it, or what only the first one moves would stay where it put it.
        restore = BlenderAnimation.restore_animation
        BlenderAnimation.restore_animation = staticmethod(
            lambda state, first: restore(state, chosen_track(state, choice)))
        try:
            keep(gltf)
        finally:
            BlenderAnimation.restore_animation = staticmethod(restore)

    gltf2_blender_scene.BlenderScene.create_animations = staticmethod(create)
    try:
        bpy.ops.import_scene.gltf(filepath=path)
    finally:
        gltf2_blender_scene.BlenderScene.create_animations = staticmethod(keep)
    if not states:
        raise RuntimeError("Blender imported nothing")
    return states[0]


def chosen_track(gltf, choice):
    """The NLA track of an animation by its name, else its index; the first where none is named."""
    animations = gltf.data.animations
    named = [i for i, animation in enumerate(animations) if choice and animation.name == choice]
    return animations[named[0] if named else int(choice or 0)].track_name


def nodes_of_scene(gltf, number):
    """The nodes below the scene's roots; the importer brings in every scene's."""
    scenes = gltf.data.scenes or []
    if number is None:
        number = gltf.data.scene if gltf.data.scene is not None else 0
    if not scenes:
        return set(range(len(gltf.data.nodes or [])))
    found, waiting = set(), list(scenes[number].nodes or [])
    while waiting:
        node = waiting.pop()
        if node not in found:
            found.add(node)
            waiting.extend(gltf.data.nodes[node].children or [])
    return found


def prepare_objects(gltf, number):
    """Numbers the meshes by their glTF node and hides those of other scenes."""
    shown = nodes_of_scene(gltf, number)
    for vnode in gltf.vnodes.values():
        if vnode.mesh_node_idx is None or vnode.blender_object is None:
            continue
        vnode.blender_object.pass_index = (vnode.mesh_node_idx + 1) & MAX_OBJECT
        vnode.blender_object.hide_render = vnode.mesh_node_idx not in shown


def alpha_input(material):
    """The socket that holds the base colour's alpha, as the importer wired it, or None."""
    if not material.use_nodes:
        return None
    for node in material.node_tree.nodes:
        if node.type == "BSDF_PRINCIPLED":
            return node.inputs["Alpha"]
    # Unlit: what reaches the output is a mix of transparency and light, by alpha.
    for node in material.node_tree.nodes:
        if node.type == "OUTPUT_MATERIAL" and node.inputs["Surface"].is_linked:
            mix = node.inputs["Surface"].links[0].from_node
            if mix.type == "MIX_SHADER":
                return mix.inputs[0]
    return None


def simplify(material, cull, alpha):
    """Replaces the surface by white light where it is there and full transparency where it is not.
    Cycles writes depth and ids at the first surface whose alpha reaches the view layer's threshold,
    so other materials would change them."""
    cut = None
    if alpha and material.blend_method == "CLIP":
        cut = alpha_input(material)
    culled = cull and material.use_backface_culling
    threshold = material.alpha_threshold
    material.use_nodes = True
    tree = material.node_tree
    nodes, links = tree.nodes, tree.links

    emission = nodes.new("ShaderNodeEmission")
    surface = emission.outputs[0]
    hidden = None
    if culled:
        hidden = nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"]
    if cut is not None:
        below = nodes.new("ShaderNodeMath")
        below.operation = "LESS_THAN"
        below.inputs[1].default_value = threshold
        if cut.is_linked:
            links.new(below.inputs[0], cut.links[0].from_socket)
        else:
            below.inputs[0].default_value = cut.default_value
        if hidden is None:
            hidden = below.outputs[0]
        else:
            either = nodes.new("ShaderNodeMath")
            either.operation = "MAXIMUM"
            links.new(either.inputs[0], hidden)
            links.new(either.inputs[1], below.outputs[0])
            hidden = either.outputs[0]
    if hidden is not None:
        mix = nodes.new("ShaderNodeMixShader")
        links.new(mix.inputs[0], hidden)
        links.new(mix.inputs[1], surface)
        links.new(mix.inputs[2], nodes.new("ShaderNodeBsdfTransparent").outputs[0])
        surface = mix.outputs[0]

    for node in [node for node in nodes if node.type == "OUTPUT_MATERIAL"]:
        nodes.remove(node)
    output = nodes.new("ShaderNodeOutputMaterial")
    links.new(output.inputs["Surface"], surface)


def prepare_materials(cull, alpha):
    # Primitives without a material have glTF's default one: opaque and single-sided.
    default = bpy.data.materials.new("octrace default")
    default.use_backface_culling = True
    for mesh in bpy.data.meshes:
        if not mesh.materials:
            mesh.materials.append(default)
        for slot, material in enumerate(mesh.materials):
            if material is None:
                mesh.materials[slot] = default
    for material in bpy.data.materials:
        simplify(material, cull, alpha)


def widen_shape_keys():
    """The importer lets a morph target's weight leave [0, 1] only as far as its first key does."""
    for keys in bpy.data.shape_keys:
        for block in keys.key_blocks:
            block.slider_min, block.slider_max = -10.0, 10.0  # as far as Blender goes


def set_time(scene, seconds):
    # The importer puts keys at seconds * fps, whatever fps_base says.
    frame = (seconds or 0.0) * scene.render.fps
    whole = math.floor(frame)
    scene.frame_set(whole, subframe=frame - whole)


def prepare_render(scene):
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = 1
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False  # the default; Debian's build aborts on it
    cycles.pixel_filter_type = "BLACKMAN_HARRIS"
    cycles.filter_width = 0.01
    cycles.max_bounces = 0
    cycles.transparent_max_bounces = 1024
    scene.render.film_transparent = True
    scene.render.dither_intensity = 0
    scene.render.use_compositing = False
    scene.render.use_sequencer = False
    scene.render.use_border = False
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.exr_codec = "ZIP"
    layer = scene.view_layers[0]
    layer.name = "ViewLayer"
    layer.use_pass_combined = True
    layer.use_pass_z = True
    layer.use_pass_normal = True
    layer.use_pass_position = True
    layer.use_pass_object_index = True


def set_camera(scene, view):
    data = bpy.data.cameras.new("octrace")
    camera = bpy.data.objects.new("octrace", data)
    scene.collection.objects.link(camera)
    columns = view["matrix"]
    matrix = Matrix([[columns[4 * column + row] for column in range(4)] for row in range(4)])
    if matrix.determinant() < 0:
        raise RuntimeError("a mirrored camera, which Blender does not have")
    camera.matrix_world = TO_BLENDER @ matrix
    width, height = view["width"], view["height"]
    across = view["right"] - view["left"]
    up = view["top"] - view["bottom"]

    # Pixels that are not square, as a pinhole camera's fx and fy may have it. Blender takes the
    # aspects from 1 on.
    aspect = (across / width) / (up / height)
    scene.render.pixel_aspect_x = max(aspect, 1.0)
    scene.render.pixel_aspect_y = max(1.0 / aspect, 1.0)
    scene.render.resolution_x, scene.render.resolution_y = width, height

    data.sensor_fit = "VERTICAL"
    if view["type"] == "orthographic":
        data.type = "ORTHO"
        data.ortho_scale = up
    else:
        # The lens that sees `up` at distance 1; the sensor is a unit only.
        data.type = "PERSP"
        data.lens_unit = "MILLIMETERS"
        data.sensor_height = 24.0
        data.lens = data.sensor_height / up
    # The principal point, as a share of the image's height, which VERTICAL makes the unit.
    data.shift_x = 0.5 * (view["left"] + view["right"]) / up
    data.shift_y = 0.5 * (view["top"] + view["bottom"]) / up
    data.clip_start = view["clip_start"]
    data.clip_end = view["clip_end"]
    scene.camera = camera


def render(scene, view):
    output = absolute(view["output"])
    set_camera(scene, view)
    # Blender replaces '#' in names by the frame, so it gets a name of our own in the same folder.
    handle, temporary = tempfile.mkstemp(
        prefix=".octrace-", suffix=".exr", dir=os.path.dirname(output) or ".")
    os.close(handle)
    os.remove(temporary)
    try:
        scene.render.filepath = temporary
        bpy.ops.render.render(write_still=True)
        if not os.path.exists(temporary) or os.path.getsize(temporary) == 0:
            raise RuntimeError("Blender wrote no image")
        os.replace(temporary, output)
    finally:
        if os.path.exists(temporary):
            os.remove(temporary)
    print("octrace: rendered " + view["output"], flush=True)


def remove_outputs(job):
    for entry in job["scenes"]:
        for view in entry["views"]:
            output = absolute(view["output"])
            if os.path.lexists(output):
                os.remove(output)


def main(job):
    failed = []

    def report(what):
        traceback.print_exc()
        failed.append(what)
        print("octrace: failed %s: %s" % (what, sys.exc_info()[1]), flush=True)

    remove_outputs(job)
    for entry in job["scenes"]:
        try:
            bpy.ops.wm.read_factory_settings(use_empty=True)
            seconds = entry.get("seconds")
            gltf = import_gltf(absolute(entry["file"]), seconds is not None,
                               entry.get("animation", ""))
            if seconds is not None:
                widen_shape_keys()
            set_time(bpy.context.scene, seconds)
            prepare_objects(gltf, entry.get("gltf_scene"))
            prepare_materials(entry["cull"], entry["alpha"])
            prepare_render(bpy.context.scene)
        except Exception:
            report(entry["file"])
            continue
        for view in entry["views"]:
            try:
                render(bpy.context.scene, view)
            except Exception:
                report(view["output"])
    if failed:
        raise RuntimeError("%d of the scenes and views failed" % len(failed))


main(JOB)
