# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The 3-D view of the viewer: the links of an arm, and the efforts and other marks of `~/markers`.

A link is drawn with the visuals of the URDF and the meshes that are found. A link without visuals
is drawn as a bone from joint to joint, so that every arm is visible.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import ModelError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.urdf.inertials import read_joint_origins
from robot_dynamics.urdf.mesh_files import check_mesh_file, find_mesh, find_untrusted_mesh
from robot_dynamics_tools.pictures.arm_marks import ArmMarks
from robot_dynamics_tools.viewer.views import newest_view, spread
from robot_dynamics_tools.viewer.visuals import Colour, MeshFile, read_visuals, Visual
import trimesh
from visualization_msgs.msg import Marker

if TYPE_CHECKING:
    import viser

LINK_COLOUR = (0.72, 0.74, 0.78, 1.0)
COLOURED = ('.dae', '.glb', '.gltf', '.obj')
"""Formats of mesh files that define colours."""
BOX_FACES = 12
"""Triangles of a box, whose edges are sharp; other shapes are round."""
_BONE = 0.35
"""Radius of a bone, as a fraction of the radius of the arcs of effort."""
_STILL = 1e-6
"""Smallest motion that is sent [m], also of the components of a quaternion."""

_Key = tuple[str, int, int]
"""Namespace, number and type of a mark."""
_Part = tuple[int, Any, FloatArray]
"""A drawn link: its Pinocchio frame, its scene node, and points (m, 3) around it."""


class ArmScene:
    """One arm in the scene of a viser server; `close` removes it."""

    def __init__(
        self, server: 'viser.ViserServer', arm: ArmModel, xml: str, directory: Path | None,
        mesh_paths: Sequence[Path] = (),
    ) -> None:
        """
        Draw an arm.

        `directory` is the directory of the URDF, None for a URDF from a topic. Meshes of such a
        URDF are opened only in packages and below `mesh_paths`.
        """
        self._server, self._scene = server, server.scene
        self._arm, self._data = arm, arm.pinocchio_model.createData()
        self._marks: dict[_Key, Any] = {}
        marks = ArmMarks(arm)
        self.size, self.reach = marks.size, marks.reach
        """Radius of the arcs of effort, and length of the arm [m]."""
        self._marked = np.zeros((0, 3))
        self.missing: list[str] = []
        """Meshes that are not drawn, each with the reason."""
        self._grid = self._scene.add_grid(
            '/ground', width=4.0 * self.reach, height=4.0 * self.reach,
            cell_size=0.1 * self.reach, section_size=0.5 * self.reach)
        self._directory = None if directory is None else directory.resolve()
        self._mesh_paths = mesh_paths
        self._parts = self._draw_links(xml)

    def close(self) -> None:
        """Remove the arm."""
        for handle in (self._grid, *(part[1] for part in self._parts), *self._marks.values()):
            handle.remove()
        self._parts, self._marks = [], {}

    # ------------------------------------------------------------------ the arm

    def move(self, q: FloatArray) -> None:
        """Show the arm at q (n,)."""
        model, data = self._arm.pinocchio_model, self._data
        pin.framesForwardKinematics(model, data, self._arm.coordinates.position(q))
        with self._server.atomic():
            for frame, handle, _ in self._parts:
                place = data.oMf[frame]
                x, y, z, w = pin.Quaternion(place.rotation).coeffs().tolist()
                _set(handle, 'wxyz', np.array([w, x, y, z]))
                _set(handle, 'position', np.array(place.translation))

    def rotation(self, link: str) -> FloatArray:
        """Return the rotation (3, 3) of a link in the base frame, as it was shown last."""
        frame = self._arm.pinocchio_model.getFrameId(link, pin.FrameType.BODY)
        return np.array(self._data.oMf[frame].rotation)

    def extent(self) -> FloatArray:
        """Return points (m, 3) around the arm and its marks, as they were shown last."""
        return np.vstack([self._marked, *(
            corners @ self._data.oMf[frame].rotation.T + self._data.oMf[frame].translation
            for frame, _, corners in self._parts)])

    def _draw_links(self, xml: str) -> list[_Part]:
        parts: list[_Part] = []
        visuals, bones = read_visuals(xml), read_joint_origins(xml)
        for i, link in enumerate(self._arm.link_names):
            node = f'/arm/{i}'
            handle = self._scene.add_frame(node, show_axes=False)
            own = [visual for visual in visuals if visual.link == link]
            drawn = [trimesh.bounds.corners(bounds) @ visual.rotation.T + visual.place
                     for k, visual in enumerate(own)
                     if (bounds := self._draw_visual(f'{node}/{k}', visual)) is not None]
            if not drawn:
                drawn = self._draw_bones(node, bones.get(link, []))
            frame = self._arm.pinocchio_model.getFrameId(link, pin.FrameType.BODY)
            parts.append((frame, handle, np.vstack([np.zeros(3), *drawn])))
        return parts

    def _draw_visual(self, node: str, visual: Visual) -> FloatArray | None:
        """Draw one shape; return its lower and upper bounds (2, 3), None if it is not drawn."""
        x, y, z, w = pin.Quaternion(visual.rotation).coeffs().tolist()
        pose = {'wxyz': (w, x, y, z), 'position': tuple(visual.place.tolist())}
        colour, shape = visual.colour or LINK_COLOUR, visual.shape
        if isinstance(shape, MeshFile):
            return self._draw_mesh(node, shape, colour, pose)
        self._scene.add_mesh_simple(
            node, shape.vertices, shape.faces, color=colour[:3],
            opacity=None if colour[3] == 1.0 else colour[3],
            flat_shading=len(shape.faces) == BOX_FACES, **pose)
        return np.array(shape.bounds)

    def _draw_mesh(
        self, node: str, mesh: MeshFile, colour: Colour, pose: dict[str, Any],
    ) -> FloatArray | None:
        try:
            path = self._mesh_file(mesh.name)
        except ModelError as error:
            self.missing.append(str(error))
            return None
        scale = tuple(mesh.scale.tolist())
        try:
            check_mesh_file(path)
            scene = trimesh.load_scene(path)
            if scene.is_empty or not scene.triangles.size:
                raise ValueError('the mesh has no triangles')
            if path.suffix.lower() in COLOURED:
                self._scene.add_mesh_trimesh(node, scene, scale=scale, **pose)
            else:
                body = scene.to_mesh()
                self._scene.add_mesh_simple(
                    node, body.vertices, body.faces, color=colour[:3], scale=scale, **pose)
        except Exception as error:  # any error of a mesh reader
            self.missing.append(f'{mesh.name}: {error}')
            return None
        return np.sort(scene.bounds * mesh.scale, axis=0)

    def _mesh_file(self, name: str) -> Path:
        """Return the file of a mesh; raise ModelError if it is missing or not allowed."""
        if self._directory is None:
            return find_untrusted_mesh(name, self._mesh_paths)
        path = find_mesh(name, self._directory)
        if path is None:
            raise ModelError(f'{name}: not found')
        return path

    def _draw_bones(self, node: str, ends: Sequence[FloatArray]) -> list[FloatArray]:
        """Draw lines from the origin of a link to `ends`; return the vertices, (m, 3) each."""
        bones = {
            f'{node}/bone{k}': trimesh.creation.cylinder(
                radius=_BONE * self.size, segment=[np.zeros(3), end])
            for k, end in enumerate(ends)
            if np.isfinite(end).all() and float(np.linalg.norm(end)) > self.size * _BONE}
        for name, bone in bones.items():
            self._scene.add_mesh_simple(name, bone.vertices, bone.faces, color=LINK_COLOUR[:3])
        return [np.array(bone.vertices) for bone in bones.values()]

    # ------------------------------------------------------------------ efforts and forces

    def mark(self, markers: Sequence[Marker]) -> None:
        """Show only these markers; labels get the names of the joints, and are spread."""
        named = {
            (marker.ns, marker.id, marker.type): marker for marker in markers
            if _can_be_drawn(marker)}
        self._marked = np.vstack([np.zeros((0, 3)), *(
            _points(one) if one.points else _position(one)
            for one in named.values())])
        looks = {key: _looks(marker) for key, marker in named.items()}
        for key, look in looks.items():
            if 'text' in look and key[1] < self._arm.joint_count:
                look['text'] = f'{self._arm.joint_names[key[1]]}: {look["text"]}'
        labels = [look for look in looks.values() if 'text' in look]
        places = np.array([label['position'] for label in labels]).reshape(-1, 3)
        anchors = spread(
            newest_view(self._server.get_clients().values()), places,
            [label['text'] for label in labels])
        for label, place, anchor in zip(labels, places, anchors):
            label.update(position=place, anchor=anchor)
        with self._server.atomic():
            for key in [key for key in self._marks if key not in named]:
                self._marks.pop(key).remove()
            for key, marker in named.items():
                if key not in self._marks:
                    self._marks[key] = self._add_mark(
                        f'/marks/{key[0]}/{key[1]}', marker, looks[key])
                for name, value in looks[key].items():
                    _set(self._marks[key], name, value)

    def _add_mark(self, node: str, marker: Marker, look: dict[str, Any]) -> Any:
        if marker.type == Marker.LINE_STRIP:
            return self._scene.add_line_segments(node, **look, thickness=marker.scale.x)
        if marker.type == Marker.ARROW:
            return self._scene.add_arrows(
                node, **look, colors=_rgb(marker), shaft_radius=0.5 * marker.scale.x,
                head_radius=0.5 * marker.scale.y)
        if marker.type == Marker.SPHERE:
            return self._scene.add_icosphere(
                node, **look, radius=0.5, color=_rgb(marker),
                opacity=None if marker.color.a == 1.0 else marker.color.a)  # visible in a pale one
        return self._scene.add_label(node, **look)


def _can_be_drawn(marker: Marker) -> bool:
    points = {Marker.LINE_STRIP: 2, Marker.ARROW: 2, Marker.SPHERE: 0, Marker.TEXT_VIEW_FACING: 0}
    return marker.action == Marker.ADD and marker.type in points and (
        len(marker.points) >= points[marker.type])


def _looks(marker: Marker) -> dict[str, Any]:
    """Return the properties of a mark that may change, with their names in viser."""
    points = _points(marker).astype(np.float32)
    if marker.type == Marker.LINE_STRIP:
        segments = np.stack([points[:-1], points[1:]], axis=1)
        return {'points': segments, 'colors': _rgb(marker)}
    if marker.type == Marker.ARROW:
        return {'points': points[None, :2], 'head_length': marker.scale.z}
    if marker.type == Marker.TEXT_VIEW_FACING:
        return {'position': _position(marker), 'text': marker.text}
    turn, size = marker.pose.orientation, marker.scale
    return {'position': _position(marker), 'wxyz': np.array([turn.w, turn.x, turn.y, turn.z]),
            'scale': (size.x, size.y, size.z)}


def _set(handle: Any, name: str, value: Any) -> None:
    """Set a property of a scene node if it has changed; what is set is sent."""
    now = getattr(handle, name)
    if now != value if isinstance(value, str) else (
            np.shape(now) != np.shape(value) or np.abs(np.subtract(now, value)).max() > _STILL):
        setattr(handle, name, value)


def _points(marker: Marker) -> FloatArray:
    return np.array([(point.x, point.y, point.z) for point in marker.points])


def _position(marker: Marker) -> FloatArray:
    place = marker.pose.position
    return np.array([place.x, place.y, place.z])


def _rgb(marker: Marker) -> npt.NDArray[np.uint8]:
    colour = np.array([marker.color.r, marker.color.g, marker.color.b])
    return np.round(255.0 * colour).astype(np.uint8)
