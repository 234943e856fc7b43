"""Builds a goblet on a table in Blender, with one lamp of 400 W and a camera, and exports it as glTF.

    python3.11 -m venv venv && venv/bin/pip install bpy==4.2.0 'numpy<2'
    venv/bin/python tests/models/goblet.py goblet.glb && abbe render goblet.glb

Whether the picture is worth keeping is for the eye.
"""

import math
import os
import sys

import bpy

# outer and inner side, turned about z: radius and height in meters
OUTER = [
    (0.0, 0.0), (0.035, 0.0), (0.036, 0.002), (0.030, 0.005), (0.012, 0.009), (0.0055, 0.018), (0.0045, 0.045),
    (0.0050, 0.075), (0.010, 0.088), (0.026, 0.105), (0.036, 0.130), (0.038, 0.155), (0.036, 0.180), (0.033, 0.200),
]  # fmt: skip
INNER = [(0.0318, 0.2005), (0.0345, 0.180), (0.0363, 0.155), (0.0343, 0.131), (0.024, 0.107), (0.010, 0.094), (0.0, 0.092)]
SIDES = 96


def turned(profile):
    """Vertices and faces of a profile turned about z; on the axis there is one vertex."""
    vertices, faces, rings = [], [], []
    for radius, z in profile:
        count = SIDES if radius > 0 else 1
        rings.append([len(vertices) + i for i in range(count)])
        angles = (2 * math.pi * i / SIDES for i in range(count))
        vertices += [(radius * math.cos(a), radius * math.sin(a), z) for a in angles]
    for below, above in zip(rings, rings[1:]):
        for i in range(SIDES):
            j = (i + 1) % SIDES
            corners = [below[i % len(below)], below[j % len(below)], above[j % len(above)], above[i % len(above)]]
            faces.append(list(dict.fromkeys(corners)))
    return vertices, faces


def material(name, **inputs):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    for key, value in inputs.items():
        made.node_tree.nodes["Principled BSDF"].inputs[key.replace("_", " ")].default_value = value
    return made


bpy.ops.wm.read_factory_settings(use_empty=True)
mesh = bpy.data.meshes.new("goblet")
vertices, faces = turned(OUTER + INNER)
mesh.from_pydata(vertices, [], faces)
goblet = bpy.data.objects.new("goblet", mesh)
bpy.context.scene.collection.objects.link(goblet)
bpy.context.view_layer.objects.active = goblet
goblet.select_set(True)
bpy.ops.object.mode_set(mode="EDIT")
bpy.ops.mesh.select_all(action="SELECT")
bpy.ops.mesh.normals_make_consistent(inside=False)
bpy.ops.object.mode_set(mode="OBJECT")
goblet.modifiers.new("smooth", "SUBSURF").levels = 2
bpy.ops.object.shade_smooth()
goblet.data.materials.append(material("crystal", Transmission_Weight=1.0, Roughness=0.0, IOR=1.5))

bpy.ops.mesh.primitive_plane_add(size=2)
bpy.context.object.data.materials.append(material("table", Base_Color=(0.45, 0.25, 0.12, 1.0), Roughness=0.6))
bpy.ops.object.light_add(type="POINT", location=(0.5, -0.6, 0.9))
bpy.context.object.data.energy = 400
bpy.ops.object.empty_add(location=(0, 0, 0.09))
target = bpy.context.object
bpy.ops.object.camera_add(location=(0.0, -0.62, 0.28))
view = bpy.context.object.constraints.new("TRACK_TO")
view.target, view.track_axis, view.up_axis = target, "TRACK_NEGATIVE_Z", "UP_Y"

bpy.ops.export_scene.gltf(filepath=sys.argv[1], export_lights=True, export_cameras=True, export_apply=True)
# Blender as a module may fall over its own end
sys.stdout.flush()
os._exit(0)
