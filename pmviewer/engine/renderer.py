"""Passes one after another: the whole program without window and threads of its own.

`Renderer.step()` is one pass: photons, maps, eye pass, film. Everything in a pass is keyed by (seed, pass), so the film
after n passes does not depend on who called `step`, on threads, or on what was stored.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.apart import check_apart
from pmviewer.engine.auto.bias import way_of
from pmviewer.engine.auto.estimate import ErrorEstimate
from pmviewer.engine.automatic import automatic_values
from pmviewer.engine.diagnose import Looked, inspected
from pmviewer.engine.exposure import metered
from pmviewer.engine.focus import focused
from pmviewer.engine.frame import Frame
from pmviewer.engine.immersion import immersed
from pmviewer.engine.inspection import Inspection, Wanted
from pmviewer.engine.inspector.watched import Watched
from pmviewer.engine.make_frame import frame_of
from pmviewer.engine.memory import check_memory
from pmviewer.engine.method import plan_of, radii_of_pixels
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.radius import NO_RADII, FirstRadii
from pmviewer.engine.stages.eye import gather_rays_of, marks_of, render_into
from pmviewer.engine.stages.first_photons import TRACED
from pmviewer.engine.stages.importance import ImportanceStage
from pmviewer.engine.stages.light import LightStage
from pmviewer.engine.stages.pass_data import RenderedPass
from pmviewer.engine.stages.pass_maps import Carried
from pmviewer.engine.stages.pass_stages import MadeAhead, PassStages
from pmviewer.engine.stages.spread import radii_of_first_pass
from pmviewer.engine.stages.virtual_lights import film_of
from pmviewer.engine.store import StageStore
from pmviewer.engine.tally import Tally
from pmviewer.engine.told import Told, told_of
from pmviewer.engine.wanted import wanted_of
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.progress import Cancelled
from pmviewer.render.adaptive import DECIDED_AFTER, cost_of, doublings_of
from pmviewer.render.camera import CameraPose, resolve_camera
from pmviewer.render.clip import clipped
from pmviewer.render.film import Addable, Film, Increment
from pmviewer.render.filter import filter_of, reach_of
from pmviewer.render.free_camera import resolve_view
from pmviewer.render.gather.gather_points import POINT_COLUMNS
from pmviewer.render.moments import Moments
from pmviewer.render.pixel_radius import OF_CAUSTIC, OF_GLOBAL, RADIUS, first_radii, shrink
from pmviewer.render.pixel_samples import samples_by_marks, with_doublings
from pmviewer.render.planes import PLANES
from pmviewer.settings.access import Settings
from pmviewer.settings.needs import Facts
from pmviewer.state import State

COARSE_SHRINK = 4
COARSE_PHOTONS = TRACED
COARSE_PIXELS = 160 * 160


def _settled(scene: OpenScene, camera: CameraPose) -> CameraPose:
    """The camera with what only the scene can tell: where its lens is focused, and which medium it is in."""
    return immersed(scene.flat, focused(scene.flat, camera))


class Renderer:
    """One scene with one set of settings. `film` holds what was rendered, `passes` how many passes that is, `latest`
    the last of them, None before the first.

    `render_camera` decides importance, stored photons and radii, `camera` what the film shows: the same unless the free
    camera is on.
    """

    def __init__(
        self,
        scene: OpenScene,
        settings: Settings,
        pool: WorkPool,
        store: StageStore,
        version: int = 0,
        plan: Plan | None = None,
        first: FirstRadii | None = None,
    ) -> None:
        """plan: what runs, where that is not what settings and scene ask for; first: radii of the first pass, where
        these are not theirs. Raises SettingError when the camera is impossible or the image can't fit into memory,
        Cancelled when the pool is cancelled."""
        self.scene, self.settings, self.pool, self.store, self.version = scene, settings, pool, store, version
        render_camera = resolve_camera(scene.scene, settings.camera)
        bounds = scene.flat.center, scene.flat.radius
        self.render_camera = _settled(scene, clipped(render_camera, settings.camera, *bounds))
        self.camera = _settled(scene, resolve_view(scene.scene, settings, *bounds))
        self.plan: Plan = plan or plan_of(settings, scene.traits)
        check_memory(self.camera.width, self.camera.height, settings.photons.N, self.plan.filtered)
        self.facts = Facts(settings, self.plan, scene.traits)
        self.film = film_of(settings, self.plan, self.camera.width, self.camera.height)
        if settings.region.on and not self.plan.virtual:
            self.film.region = settings.region.pixels(self.camera.width, self.camera.height)
        if self.plan.moments:
            self.film.moments = Moments(len(self.film.sums), self.film.refined)
        chosen = filter_of(self.camera.filter, settings.render)
        self._reach = reach_of(chosen, self.camera.pixel_side) if self.plan.filtered else 0
        self.error = ErrorEstimate(self.camera.width, self.camera.height, settings, self.plan, self._reach)
        self.error.bias = scene.biases.get(way_of(settings)) if scene.biases else None
        self.tally = Tally()
        radii = first or NO_RADII
        if self.plan.photons and first is None:
            asked = scene, settings, self.plan, self.render_camera, pool.run, store
            radii = self.tally.timed(pool, "light pass", lambda: radii_of_first_pass(*asked))
        self.settled_radii = radii
        """Of the film's first pass; those of a coarse picture are larger."""
        self._stages = PassStages(scene, settings, self.plan, self.render_camera, radii, pool, store, self.tally)
        self._next: MadeAhead | None = None
        self.latest: RenderedPass | None = None
        self.coarse_pass: RenderedPass | None = None
        """What made the coarse frame, until the first pass."""
        self._apart: Film | None = None
        self._told: Told | None = None
        self._marks: NDArray[np.uint8] | None = None
        self._watched = Watched()

    @property
    def first_radius(self) -> float:
        """Of look-ups in the global map in the first pass, in scene units; 0 without photons."""
        return self._stages.first.global_

    @property
    def light(self) -> LightStage:
        """Photons and maps of the latest pass."""
        return self._stages.light

    @property
    def importance(self) -> ImportanceStage:
        """Importance in the latest pass."""
        return self._stages.importance

    @property
    def passes(self) -> int:
        """Those that are in the film."""
        return self.film.passes

    @property
    def finished(self) -> bool:
        """Whether a stop rule holds."""
        return self.stops_by(self.settings)

    def stops_by(self, settings: Settings) -> bool:
        """Whether a stop rule of these settings holds, which may differ from the renderer's own in nothing else."""
        render = settings.render
        if self.passes >= render.passes or 0 < render.time_limit <= self.tally.seconds:
            return True
        if render.error <= 0:
            return False
        remaining = self.error.latest
        return remaining is not None and remaining.relmse <= render.error

    def step(self) -> None:
        """Render the next pass into the film.

        Raises Cancelled, leaving the film unusable, when the pool is cancelled meanwhile.
        """
        start, index, N = time.perf_counter(), self.passes, self.settings.photons.N
        try:
            made = self._taken(index) or self._maps(self.film, self.camera, index, N)
            self._make_ahead(made, index + 1, N)
            self._eye_pass(made, self.film)
        except BaseException:
            self.drop()
            raise
        self._close_pass()
        self.tally.seconds += time.perf_counter() - start
        if self.finished:
            self.drop()

    def drop(self) -> None:
        """Make nothing ahead of what is asked for: nobody will ask for it."""
        if self._next is not None:
            self._next.drop()
            self._next = None

    def increment(self, index: int, lent: bool = False) -> Increment:
        """What pass `index` adds to the film, which stays as it is: `add` takes it, here or elsewhere. `lent` arrays
        hold until the next increment alone, and cost no new memory. Raises SettingError where passes can't be rendered
        apart."""
        check_apart(self.facts)
        film = self._apart
        if film is None or film.region is not None:  # pixels beyond a region would keep what they had
            film = film_of(self.settings, self.plan, self.camera.width, self.camera.height)
            film.region, film.latest_alone = self.film.region, True
        self._apart = film if lent else None
        film.passes = index
        self._pass(film, self.camera, index, self.settings.photons.N)
        return Increment(film.sums)

    def told(self) -> Told:
        """What there is to say of the latest pass beyond the tally: of one from elsewhere what was said there."""
        return self._told if self._told is not None else told_of(self._looked(self.film), self.tally)

    def add(self, increment: Addable, told: Told | None = None) -> None:
        """Take the next pass from elsewhere, with what was told of it there. The film is as if `step` had rendered it;
        the tally is the caller's. Its photons and maps are not here: `latest` is None until `recall`."""
        increment.add_to(self.film)
        self.latest, self._told = None, told
        if self.film.moments is not None:
            self.film.moments.add(self.film.sums, self.film.channels, 0, len(self.film.sums))
        self._close_pass()

    def recall(self) -> None:
        """Have photons and maps of the latest pass here, when it was rendered elsewhere; nothing counts again."""
        if self.latest is None and self.passes:
            with self.tally.aside():
                self._maps(self.film, self.camera, self.passes - 1, self.settings.photons.N, again=True)

    def _close_pass(self) -> None:
        self.film.passes += 1
        self.coarse_pass = None
        self._adapt()
        if self.film.moments is not None:
            self.film.moments.close_pass()
        self.error.add(self.film, self.pool.run)

    def _adapt(self) -> None:
        """Decide which pixels get more samples, when it is time."""
        film = self.film
        if not self.plan.adaptive or film.passes != DECIDED_AFTER or film.moments is None:
            return
        marks, plan = self._still_marks(film), self.plan
        marks = marks if len(marks) else np.zeros(len(film.sums), np.uint8)
        samples = samples_by_marks(marks, plan.mirror_rays, plan.edge_rays)
        cost = cost_of(samples, film.sums[:, PLANES["normal"]] / film.passes)
        made = partial(doublings_of, film.moments, (film.height, film.width), cost, self._reach, film.refined)
        film.doublings = self.tally.timed(self.pool, "camera pass", lambda: self.pool.run([made])[0])

    def state(self) -> State:
        """The film and all that goes on with it: error estimate, counts, exposure, and what a pass takes over from
        those before it. Arrays are the renderer's own: they hold until the next pass."""
        maps = self.light.latest
        return State.of_parts(
            {"exposures": dict(self.scene.exposures)},
            {},
            film=self.film.state(),
            error=self.error.state(),
            tally=self.tally.state(),
            carried=(maps.taken_over if maps is not None else self.light.taken_over).state(),
        )

    def restore(self, state: State) -> None:
        """Go on from the state of a renderer of the same scene and settings, bit for bit, as if this one had rendered
        its passes. What the latest of them looked up is made again, for whoever wants to see it.

        Raises ValueError for a state of another film, and Cancelled when the pool is cancelled; either leaves the
        renderer unusable.
        """
        self.film.restore(state.part("film"))
        self.error.restore(state.part("error"))
        self.scene.exposures.update({str(name): float(ev) for name, ev in state.number("exposures").items()})
        if self.passes:
            self.light.taken_over = Carried.restored(state.part("carried"))
            self._maps(self.film, self.camera, self.passes - 1, self.settings.photons.N, again=True)
        self.tally.restore(state.part("tally"))

    def photons_alone(self, passes: int) -> PhotonMaps | None:
        """The photons of the last of so many passes, without a picture: what `step` would trace for it. None where the
        plan has none. For a renderer that is used for nothing else."""
        for index in range(passes):
            if index < passes - 1 and radii_of_pixels(self.facts):
                self.step()  # what pixels found decides about the next pass
            else:
                self._stages.run_light(index, self.settings.photons.N, self._radii_of_pixels(self.film))
        return self.light.photons

    def coarse_frame(self, serial: int, wanted: Wanted | None = None) -> Frame:
        """A quick picture: a fraction of the pixels and photons, not part of the film. `wanted` as for `frame`."""
        pose = self.camera
        shrink = COARSE_SHRINK
        while pose.width * pose.height > COARSE_PIXELS * shrink * shrink:
            shrink *= 2
        small = CameraPose(**{**pose.__dict__, "width": -(-pose.width // shrink), "height": -(-pose.height // shrink)})
        film = film_of(self.settings, self.plan, small.width, small.height)
        N = min(self.settings.photons.N, COARSE_PHOTONS)
        first = self.settled_radii.scaled(min(2.0, (self.settings.photons.N / N) ** 0.25))
        plan = replace(self.plan, edge_rays=1)  # it is blurred anyway
        quick = Renderer(self.scene, self.settings, self.pool, self.store, self.version, plan, first)
        quick.settled_radii = self.settled_radii
        quick._pass(film, small, 0, N)
        self.coarse_pass = quick.latest
        film.passes = 1
        if self.scene.scene.exposure is None:
            self.scene.exposures.setdefault(self.settings.camera.name, metered(film.planes()))
        wanted = replace(wanted or wanted_of(self.facts), pixel=None, pinned=None)  # its pixels are others
        return quick._frame(serial, film, True, wanted)

    def frame(self, serial: int, wanted: Wanted | None = None) -> Frame:
        """The film as it stands, with what the display wants to know of the latest pass (None: by the settings)."""
        return self._frame(serial, self.film, False, wanted)

    def inspect(self, wanted: Wanted) -> Inspection:
        """What is wanted of the latest pass. The film stays as it is."""
        self.recall()
        return inspected(wanted, self._looked(self.film), self.pool)

    def looked_at(self, frame: Frame, serial: int, wanted: Wanted) -> Frame:
        """The frame of the latest pass with what is wanted of it, under that serial number."""
        held, inspection = frame.clouds, self.inspect(wanted)
        if wanted.points and not held:  # the pass was rendered elsewhere
            return replace(self.frame(serial, wanted), preview=frame.preview)
        return replace(frame, serial=serial, inspection=inspection)

    def gather_points(self, x: int, y: int) -> NDArray[np.float32]:
        """The gather rays of a pixel in the last pass, (n, POINT_COLUMNS), see `pmviewer.render.gather.gather_points`.

        None with methods that don't gather, before the first pass, and for pixels outside the image.
        """
        self.recall()
        if self.latest is None:
            return np.empty((0, POINT_COLUMNS), np.float32)
        return gather_rays_of(self.latest, x, y, self.pool)

    def _frame(self, serial: int, film: Film, coarse: bool, wanted: Wanted | None) -> Frame:
        wanted = wanted or wanted_of(self.facts)
        if wanted.of_pass and film is self.film:
            self.recall()
        looked = self._looked(film)
        inspection = inspected(wanted, looked, self.pool)
        told = self.told() if film is self.film else told_of(looked, self.tally)
        made = replace(
            frame_of(looked, self.tally, inspection, told), serial=serial, version=self.version, coarse=coarse
        )
        return replace(
            made,
            automatic=automatic_values(looked, self.settled_radii),
            statistics=replace(made.statistics, remaining=None if coarse else self.error.latest),
        )

    def _looked(self, film: Film) -> Looked:
        stages = self.light, self.importance, self.latest
        return Looked(self.scene, self.settings, self.plan, self.camera, film, *stages, self._watched)

    def _pass(self, film: Film, camera: CameraPose, index: int, N: int) -> None:
        self._eye_pass(self._maps(film, camera, index, N), film)

    def _maps(self, film: Film, camera: CameraPose, index: int, N: int, again: bool = False) -> RenderedPass:
        """All of pass `index` but its picture; `again` for a pass that is in the film already."""
        marks = self.tally.timed(self.pool, "edges and mirrors", lambda: self._marks_of(film, index))
        self.latest = self._stages.run(camera, marks, index, N, self._radii_of_pixels(film, again))
        self._told = None
        return self.latest

    def _make_ahead(self, made: RenderedPass, index: int, N: int) -> None:
        """Begin with all of pass `index` but its picture, where it will be asked for and nothing forbids it."""
        if (
            index < self.settings.render.passes
            and not radii_of_pixels(self.facts)
            and self._stages.can_run_early(index)
        ):
            self._next = MadeAhead(self._stages, self.camera, self._still_marks(self.film), index, N)

    def _taken(self, index: int) -> RenderedPass | None:
        """All of pass `index` but its picture, if that has been made ahead."""
        ahead, self._next = self._next, None
        if ahead is None:
            return None
        if ahead.index != index:
            ahead.drop()
            return None
        try:
            self._stages, self.latest = ahead.take(self._stages)
        except Cancelled:
            if self.pool.cancel.is_set():
                raise
            return None  # that was meant for the pass before, which was through by then
        self.latest = replace(self.latest, marks=self._marks_of(self.film, index))  # decided on meanwhile
        self._told = None
        return self.latest

    def _marks_of(self, film: Film, index: int) -> NDArray[np.uint8]:
        """In pass `index`, of the renderer's film or a smaller one."""
        marks, doublings = self._still_marks(film), self.film.doublings
        if doublings is None or index < DECIDED_AFTER:
            return marks
        return with_doublings(marks, doublings)

    def _still_marks(self, film: Film) -> NDArray[np.uint8]:
        """Those that are the same in all passes."""
        if self.plan.path:
            return np.zeros(0, np.uint8)
        if self._marks is None:  # the store may keep nothing
            of_view = self.scene, self.camera, film, self.settings, self.plan, self.store
            self._marks = marks_of(*of_view, self.pool.run)
        return self._marks

    def _eye_pass(self, rendered: RenderedPass, film: Film) -> None:
        render = partial(render_into, film, rendered.given, rendered.marks, self.plan, self.pool)
        self.tally.add_counts(self.tally.timed(self.pool, "camera pass", render))

    def _radii_of_pixels(self, film: Film, again: bool = False) -> dict[str, float]:
        """Gives the pixels the radii of the next pass, unless they have them `again`; returns the largest by map. None
        without the rule."""
        if not radii_of_pixels(self.facts):
            return {}
        estimate, first = self.settings.estimate, self._stages.first
        if film.radii is None:
            film.radii = first_radii(len(film.sums), first.caustic, first.global_)
        elif not again:
            shrink(film.radii, estimate.alpha, estimate.floor * self.scene.flat.radius)
        caustic, global_ = (float(film.radii[:, RADIUS + which].max()) for which in (OF_CAUSTIC, OF_GLOBAL))
        return {"caustic": caustic, "global": global_ if self.plan.shown_directly else 0.0}
