"""Handles in the picture that move, turn and scale what is being edited, and the box around it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from imgui_bundle import imgui, imguizmo
from numpy.typing import NDArray

from pmviewer.render.camera import CameraPose
from pmviewer.settings.edits import PROPERTIES
from pmviewer.viewer import theme
from pmviewer.viewer.viewport.target import clip_planes

if TYPE_CHECKING:
    from pmviewer.scene.editing.catalogue import Target
    from pmviewer.viewer.viewport.viewport import Viewport

G = imguizmo.im_guizmo
SIZE = 0.17
"""Of the handles, where the picture's width is 2."""
FINEST = 1e-5
"""Step of a drag, relative to the scene's radius: a point of the screen is no more precise."""
_OPERATIONS = {"move": G.OPERATION.translate, "turn": G.OPERATION.rotate, "size": G.OPERATION.scale}
_EDGES = [(a, a | bit) for a in range(8) for bit in (1, 2, 4) if not a & bit]
"""Of a box whose corners are numbered by the bits of their sides."""


class Gizmo:
    """Of one viewport. `wants_mouse`: the mouse is over a handle or drags one, and moves no camera."""

    def __init__(self, viewport: Viewport) -> None:
        self._viewport = viewport
        self._editing = viewport.state.editing
        self.wants_mouse = False
        self._box: tuple[Any, NDArray[np.float64]] | None = None

    def gui(self, pose: CameraPose | None) -> None:
        """Draw handles and box over the picture of that camera, and follow the mouse. Once per window frame."""
        editing, target = self._editing, self._editing.chosen
        catalogue = editing.catalogue
        if pose is None or catalogue is None or target is None or target.kind == "material" or self._viewport.alone:
            self.wants_mouse = False
            return
        self._draw_box(pose, target)
        operation = editing.operation
        if operation not in PROPERTIES[target.kind] or editing.refusal(target, operation) is not None:
            operation = "move"
        if editing.refusal(target, operation) is not None:
            self.wants_mouse = False
            return
        self._manipulate(pose, target, operation)

    def _manipulate(self, pose: CameraPose, target: Target, operation: str) -> None:
        from pmviewer.scene.editing.transform import similarity

        editing, middle = self._editing, self._editing.middle(target)
        values = {p: editing.value(target, p) for p in ("move", "turn", "size") if p in PROPERTIES[target.kind]}
        move, turn, (size,) = values["move"], values["turn"], values.get("size", (1.0,))
        before = similarity(np.zeros(3), middle + move, turn, size).matrix()  # type: ignore[arg-type]
        left, top, width, height = self._viewport.rectangle()
        x, y = self._viewport.origin
        G.begin_frame()
        G.set_drawlist(imgui.get_window_draw_list())
        G.set_gizmo_size_clip_space(SIZE)
        G.set_orthographic(pose.orthographic)
        G.set_rect(x + left, y + top, width, height)
        near, far = clip_planes(pose, middle + move, self._radius())
        view, projection = _matrix16(pose.view_matrix()), _matrix16(pose.projection_matrix(near, far))
        matrix = _matrix16(before)
        changed = G.manipulate(view, projection, _OPERATIONS[operation], G.MODE.world, matrix)
        self.wants_mouse = G.is_over() or G.is_using()
        if changed:
            after = np.array(matrix.values, np.float64).reshape(4, 4).T
            editing.set(target, {operation: _dragged(operation, before, after, middle, FINEST * self._radius())})

    def _draw_box(self, pose: CameraPose, target: Target) -> None:
        corners = self._corners(target)
        if corners is None:
            return
        left, top, width, height = self._viewport.rectangle()
        x, y = self._viewport.origin
        placed = pose.project(corners)
        screen = np.column_stack(
            [x + left + placed[:, 0] * width / pose.width, y + top + placed[:, 1] * height / pose.height]
        )
        painter = imgui.get_window_draw_list()
        colour = imgui.get_color_u32(imgui.ImVec4(*theme.ACCENT[:3], 0.75))
        painter.push_clip_rect((x, y), (x + self._viewport.size[0], y + self._viewport.size[1]), True)
        for a, b in _EDGES:
            if pose.orthographic or min(placed[a, 2], placed[b, 2]) > 1e-3 * self._radius():
                painter.add_line(tuple(screen[a]), tuple(screen[b]), colour, 1.5)
        painter.pop_clip_rect()

    def _corners(self, target: Target) -> NDArray[np.float64] | None:
        """(8, 3) of the box around the drawn object, None for what is not drawn."""
        geometry = self._viewport.state.session.geometry
        if geometry is None:
            return None
        if self._box is None or self._box[0] != (id(geometry), target):
            points = geometry.vertices_of(self._editing.object_number(target))
            if not len(points):
                return None
            low, high = points.min(axis=0), points.max(axis=0)
            sides = [[(high if corner >> axis & 1 else low)[axis] for axis in range(3)] for corner in range(8)]
            self._box = (id(geometry), target), np.array(sides, np.float64)
        return self._box[1]

    def _radius(self) -> float:
        geometry = self._viewport.state.session.geometry
        return float(geometry.radius) if geometry is not None else 1.0


def _matrix16(matrix: NDArray[np.float64]) -> Any:
    """Column by column, as the handles want it."""
    return G.Matrix16([float(v) for v in matrix.T.ravel()])


def _dragged(
    operation: str, before: NDArray[np.float64], after: NDArray[np.float64], middle: NDArray[np.float64], step: float
) -> tuple[float, ...]:
    """The property's new numbers from the matrices (4, 4) before and after a drag; lengths in that step."""
    from pmviewer.scene.editing.transform import angles_of

    if operation == "move":
        return tuple(float(round(v / step) * step) for v in after[:3, 3] - middle)
    scales = np.linalg.norm(after[:3, :3], axis=0)
    if operation == "turn":
        return tuple(round(angle, 2) for angle in angles_of(after[:3, :3] / scales))
    ratios = scales / np.linalg.norm(before[:3, :3], axis=0)
    size = float(np.linalg.norm(before[:3, 0]) * ratios[np.argmax(np.abs(np.log(np.maximum(ratios, 1e-6))))])
    return (float(f"{min(max(size, 1e-3), 1e3):.4g}"),)
