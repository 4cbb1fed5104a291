"""The stage of the page: camera, light, ground, bodies, and the marks of constraints, contacts and the hand."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from turnbuckle.data.shape import Shape
from turnbuckle.live.drawing import drawn_bodies
from turnbuckle.live.frame import Arrows, Frame
from turnbuckle.live.paint import PULL, PUSH, residual_colors
from turnbuckle.viewer.camera import FIELD_OF_VIEW, frame_box
from turnbuckle.viewer.geometry import SceneGeometry

DOT = 0.007  # of the scene's size: mark of a constraint
ARROW = 0.12  # of the scene's size: the longest arrow
FEW = 4000  # arrows and marks shown at most
ROOM = 0.04  # of the scene's size, around it


class Stage:
    """Draws frames into a viser scene."""

    def __init__(self, server: Any, shapes: Sequence[Shape], x: np.ndarray, up_axis: str, size: float) -> None:
        self.size, self.up_axis, self.shapes = max(size, 1e-9), up_axis, list(shapes)
        self._scene = server.scene
        geometry = SceneGeometry(self.shapes, x, up_axis)
        seen = geometry.everything(x)
        seen = seen[np.isfinite(seen).all(axis=1)]
        seen = seen if len(seen) else np.array([-np.ones(3), np.ones(3)])
        low, high = seen.min(axis=0), seen.max(axis=0)
        room = ROOM * float(np.linalg.norm(high - low))
        self.low, self.high = low, high
        self.camera = frame_box(low - room, high + room, up_axis, (1280, 800))
        first = server.initial_camera
        first.position, first.look_at, first.up = self.camera.eye, self.camera.target, self.camera.up
        first.fov = FIELD_OF_VIEW
        first.near, first.far = 1e-3 * self.size, 100.0 * self.size + float(np.linalg.norm(self.camera.eye))
        server.scene.set_up_direction("+y" if up_axis == "Y" else "+z")
        self._ground(server, geometry.ground)
        self.bodies = drawn_bodies(server.scene, self.shapes, x, self.size)
        dot = DOT * self.size
        nothing = np.zeros((0, 3), np.float32)
        self._dots = server.scene.add_point_cloud(
            "/marks/constraints", nothing, np.zeros((0, 3), np.uint8), point_size=dot, point_shape="circle",
            precision="float32",
        )  # fmt: skip
        self._axes = server.scene.add_line_segments(
            "/marks/axes", np.zeros((0, 2, 3), np.float32), np.zeros((0, 2, 3), np.uint8), thickness=0.35 * dot
        )
        self._pins = server.scene.add_point_cloud(
            "/marks/pins", nothing, np.array(PULL, np.uint8), point_size=1.7 * dot, point_shape="diamond",
            precision="float32",
        )  # fmt: skip
        slim = {"shaft_radius": 0.16 * dot, "head_radius": 0.45 * dot, "head_length": 0.9 * dot}
        self._contacts = server.scene.add_arrows(
            "/marks/contacts", np.zeros((0, 2, 3)), np.array(PUSH, np.uint8), **slim
        )
        self._pull = server.scene.add_arrows("/marks/hand", np.zeros((0, 2, 3)), np.array(PULL, np.uint8), **slim)
        self._strongest = 0.0  # [N] of contacts, slowly forgotten, so that arrows do not jump in length
        self._shown: dict[str, Any] = {}
        self.show_marks = self.show_contacts = True

    def _ground(self, server: Any, ground: float | None) -> None:
        axis = int(np.argmax(self.camera.up))
        extent = max(float(np.ptp(np.stack([self.low, self.high]), axis=0).max()), 1e-6)
        place = 0.5 * (self.low + self.high)
        place[axis] = (self.low[axis] if ground is None else ground) - 1e-3 * extent
        cell = 10.0 ** np.floor(np.log10(extent / 2.0))
        server.scene.add_grid(
            "/ground", width=8 * extent, height=8 * extent, plane="xz" if self.up_axis == "Y" else "xy",
            cell_size=cell, section_size=10 * cell, cell_color=(222, 226, 232), section_color=(200, 206, 214),
            cell_thickness=0.6, section_thickness=0.9, fade_distance=6 * extent, position=tuple(place),
            infinite_grid=False, shadow_opacity=0.18,
        )  # fmt: skip

    def show(self, frame: Frame) -> None:
        """Draw a frame. Call it within one atomic block."""
        for body in self.bodies:
            body.update(frame.x)
        self._show_marks(frame)
        self._show_arrows(frame.contacts)
        pins = frame.pins.astype(np.float32)
        self._set("pins", self._pins, "points", pins)
        pull = np.zeros((0, 2, 3))
        if frame.pull is not None:
            pull = np.stack([frame.pull.place, frame.pull.target])[None]
        self._set("pull", self._pull, "points", pull.astype(np.float32))

    def _show_marks(self, frame: Frame) -> None:
        marks = frame.marks
        if not self.show_marks or len(marks.points) > FEW or not frame.readings:
            points, colors = np.zeros((0, 3)), np.zeros((0, 3), np.uint8)
            axes, axis_colors = np.zeros((0, 2, 3)), np.zeros((0, 2, 3), np.uint8)
        else:
            color = residual_colors(frame.readings, self.size)
            points, colors = marks.points, color[marks.of]
            axes, axis_colors = marks.axes, np.repeat(color[marks.axis_of][:, None], 2, axis=1)
        self._set_pair("dots", self._dots, points.astype(np.float32), colors)
        self._set_pair("axes", self._axes, axes.astype(np.float32), axis_colors)

    def _show_arrows(self, contacts: Arrows) -> None:
        points = np.zeros((0, 2, 3))
        if self.show_contacts and len(contacts.force):
            strength = np.linalg.norm(contacts.force, axis=1)
            self._strongest = max(0.97 * self._strongest, float(strength.max()), 1e-300)
            largest = np.argsort(-strength)[:FEW]
            ends = contacts.at + ARROW * self.size / self._strongest * contacts.force
            points = np.stack([contacts.at, ends], axis=1)[np.sort(largest)]
        self._set("contacts", self._contacts, "points", points.astype(np.float32))

    def _set(self, key: str, node: Any, field: str, value: np.ndarray) -> None:
        """Send an array if it has changed."""
        old = self._shown.get(key)
        if old is None and not len(value):
            return
        if old is None or old.shape != value.shape or not np.array_equal(old, value):
            self._shown[key] = value
            setattr(node, field, value)

    def _set_pair(self, key: str, node: Any, points: np.ndarray, colors: np.ndarray) -> None:
        self._set(f"{key} colors", node, "colors", colors)
        self._set(key, node, "points", points)
