"""The tab "Scene": the lights, materials and objects of the scene, and what is changed of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from imgui_bundle import hello_imgui, imgui
from imgui_bundle import icons_fontawesome_6 as fa

from pmviewer.settings.edits import PROPERTIES, Property
from pmviewer.viewer import theme
from pmviewer.viewer.editing import OPERATIONS, Editing
from pmviewer.viewer.overlays.legend import wrapped
from pmviewer.viewer.panels.received_rows import STACKED, draw_received
from pmviewer.viewer.panels.widgets import icon_button, tooltip_text
from pmviewer.viewer.state import ViewerState

if TYPE_CHECKING:
    from pmviewer.scene.editing.catalogue import Target

SCENE = "Scene"
_HEADINGS = {"light": "Lights", "material": "Materials", "object": "Objects"}
MOST_ROWS = 200
"""Entries that are listed of a kind; the search finds the others."""
_POWER_DECADES = 3.0
_LOG = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.no_round_to_format


def follow_choice(state: ViewerState) -> None:
    """Once per window frame: bring the tab to the front when an object was chosen in the picture."""
    if not state.editing.raised:
        return
    state.editing.raised = False
    window = hello_imgui.get_runner_params().docking_params.dockable_window_of_name(SCENE)
    if window is not None and not state.panels_hidden:
        window.is_visible = window.focus_window_at_next_frame = True


class ScenePanel:
    """`gui` draws it; called once a frame while it is in front."""

    def __init__(self, state: ViewerState) -> None:
        self._state = state
        self._find = ""
        self._scrolled_to: Target | None = None

    def gui(self) -> None:
        """Draw the tab."""
        editing = self._state.editing
        catalogue = editing.catalogue
        if catalogue is None:
            imgui.text_disabled("No scene is open.")
            return
        self._head(editing)
        if imgui.begin_child("##things"):
            if not editing.edits and editing.chosen is None:
                wrapped("Shift+click an object of the picture to take hold of it. The file stays as it is.")
            for kind, heading in _HEADINGS.items():
                self._kind(editing, kind, heading, catalogue.targets[kind])
        imgui.end_child()

    def _head(self, editing: Editing) -> None:
        """The search, and the way back."""
        size = imgui.get_frame_height() * 1.15 + imgui.get_style().item_spacing.x
        imgui.set_next_item_width(-size)
        hint = f"{fa.ICON_FA_MAGNIFYING_GLASS}  find a light, material or object"
        _, self._find = imgui.input_text_with_hint("##find", hint, self._find)
        imgui.same_line()
        count = len(editing.edits)
        tip = f"Take all {count} edits back" if count else "Nothing is edited"
        if icon_button(fa.ICON_FA_ARROW_ROTATE_LEFT, "reset.edits", tip, enabled=bool(count)):
            editing.reset()

    def _kind(self, editing: Editing, kind: str, heading: str, targets: tuple[Target, ...]) -> None:
        wanted = self._find.strip().lower()
        listed = [t for t in targets if wanted in t.name.lower() or wanted == t.key.lower()]
        if not listed:
            return
        changed = sum(editing.is_edited(t) for t in targets) if editing.edits else 0
        note = f", {changed} edited" if changed else ""
        holds = editing.chosen is not None and editing.chosen.kind == kind and self._scrolled_to != editing.chosen
        if holds:
            imgui.set_next_item_open(True)
        else:
            imgui.set_next_item_open(kind == "light" or bool(wanted), imgui.Cond_.once)
        if not imgui.collapsing_header(f"{heading} ({len(targets)}{note})###{kind}"):
            return
        shown = listed[:MOST_ROWS]
        if editing.chosen in listed and editing.chosen not in shown:
            shown = [*shown, editing.chosen]
        for target in shown:
            self._target(editing, target)
        if len(listed) > len(shown):
            imgui.text_disabled(f"and {len(listed) - len(shown):,} more: search for them")

    def _target(self, editing: Editing, target: Target) -> None:
        number = editing.number(target)
        name = target.name or f"{target.kind} {number}"
        is_chosen = editing.chosen == target
        if is_chosen and self._scrolled_to != target:
            self._scrolled_to = target
            imgui.set_next_item_open(True)
            imgui.set_scroll_here_y(0.3)
        edited = editing.is_edited(target)
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*(theme.ACCENT if edited else theme.TEXT)))
        flags = imgui.TreeNodeFlags_.span_avail_width | (imgui.TreeNodeFlags_.selected if is_chosen else 0)
        is_open = imgui.tree_node_ex(f"{theme.drawable(name)}###{target.kind}.{number}", int(flags))
        imgui.pop_style_color()
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            tooltip_text([(f"{target.kind}.{target.key}", theme.ACCENT)])
        if not is_open:
            return
        if target.kind != "material":
            self._handles(editing, target, is_chosen)
        em, room = imgui.get_font_size(), imgui.get_content_region_avail().x
        stacked = room < STACKED * em
        if imgui.begin_table(f"##{target.kind}.{number}", 2 if stacked else 3, 0, (room, 0)):
            if not stacked:
                imgui.table_setup_column("name", imgui.TableColumnFlags_.width_fixed, 5.4 * em)
            imgui.table_setup_column("value", imgui.TableColumnFlags_.width_stretch)
            imgui.table_setup_column("reset", imgui.TableColumnFlags_.width_fixed, 1.75 * em)
            for prop, what in PROPERTIES[target.kind].items():
                if editing.refusal(target, prop) is None:
                    self._row(editing, target, prop, what)
            self._made_of(editing, target)
            imgui.end_table()
        if editing.object_number(target) >= 0:
            draw_received(self._state, editing.object_number(target))
        imgui.tree_pop()

    @staticmethod
    def _made_of(editing: Editing, target: Target) -> None:
        """The material of an object; a click shows it."""
        material = editing.material_of(target)
        if material is None or target.kind != "object":
            return
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.align_text_to_frame_padding()
        imgui.text_colored(theme.grey(theme.look.name), "material")
        _to_value()
        if imgui.button(f"{theme.drawable(material.name or material.key)}##of.{editing.number(target)}", (-1, 0)):
            editing.choose(material)
        imgui.set_item_tooltip("Show it in this tab")

    def _handles(self, editing: Editing, target: Target, is_chosen: bool) -> None:
        """The switch of the handles in the picture, and what they do."""
        possible = [op for op in OPERATIONS if op in PROPERTIES[target.kind] and not editing.refusal(target, op)]
        if not possible:
            return
        changed, wanted = imgui.checkbox("handles", is_chosen)
        imgui.set_item_tooltip("Show handles in the picture (Shift+click an object)")
        if changed:
            editing.choose(target if wanted else None)
            self._scrolled_to = target
        for number, op in enumerate(possible if is_chosen else ()):
            if number:  # the first stands below the switch
                _same_line_if_it_fits(op)
            if imgui.radio_button(op, editing.operation == op):
                editing.operation = op

    def _row(self, editing: Editing, target: Target, prop: str, what: Property) -> None:
        value = editing.value(target, prop)
        edited = editing.is_edited(target, prop)
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.align_text_to_frame_padding()
        imgui.push_style_color(imgui.Col_.text, imgui.ImVec4(*theme.TEXT) if edited else theme.grey(theme.look.name))
        imgui.text_unformatted(prop)
        imgui.pop_style_color()
        name = editing.name_of(target, prop)
        if imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip):
            tooltip_text([(name, theme.ACCENT), (f"{what.text[:1].upper()}{what.text[1:]}.", theme.TEXT)])
        _to_value()
        imgui.set_next_item_width(-1)
        new = _widget(f"##{target.kind}.{editing.number(target)}.{prop}", prop, what, value, self._radius())
        if new is not None:
            editing.set(target, {prop: new})
        imgui.table_next_column()
        if edited and icon_button(fa.ICON_FA_ARROW_ROTATE_LEFT, f"reset.{name}", "As the file has it"):
            editing.reset(target, prop)

    def _radius(self) -> float:
        geometry = self._state.session.geometry
        return float(geometry.radius) if geometry is not None else 1.0


def _to_value() -> None:
    """From a row's name to its value: beside it, or in a narrow panel below."""
    if imgui.table_get_column_count() > 2:
        imgui.table_next_column()


def _same_line_if_it_fits(label: str) -> None:
    """Go on beside the item before where a radio button of that label has room there."""
    style = imgui.get_style()
    wide = imgui.get_frame_height() + style.item_inner_spacing.x + imgui.calc_text_size(label).x
    right = imgui.get_cursor_screen_pos().x + imgui.get_content_region_avail().x
    if imgui.get_item_rect_max().x + style.item_spacing.x + wide < right:
        imgui.same_line()


def _widget(label: str, prop: str, what: Property, value: tuple[float, ...], radius: float) -> tuple[float, ...] | None:
    """What suits the property; the new value, None where it is as it was. `radius` of the scene gives drags their
    speed. Ctrl+click types a number."""
    if prop == "colour":
        flags = imgui.ColorEditFlags_.float | (imgui.ColorEditFlags_.hdr if what.high > 1 else 0)
        changed, rgb = imgui.color_edit3(label, list(value), int(flags))
        return _bounded(what, rgb) if changed else None
    if what.count == 3:
        speed = 0.002 * radius if prop == "move" else 0.25
        changed, three = imgui.drag_float3(label, list(value), speed, 0, 0, "%.4g")
        return _bounded(what, three) if changed else None
    (number,) = value
    if prop in ("power", "size"):
        high = 10.0**_POWER_DECADES
        shown = "%.4g ×"
        changed, number = imgui.slider_float(label, number, 1 / high, high, shown, _LOG)
    else:
        changed, number = imgui.slider_float(label, number, what.low, what.high, "%.3g")
    return _bounded(what, [number]) if changed else None


def _bounded(what: Property, numbers: list[float]) -> tuple[float, ...]:
    return tuple(min(max(float(number), what.low), what.high) for number in numbers)
