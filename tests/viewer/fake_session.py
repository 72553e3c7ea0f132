"""A session without an engine: publishes made-up frames at once, and remembers what it was asked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pmviewer.engine.energy import Energy
from pmviewer.engine.frame import Frame, Message, PhotonCloud, Statistics, Status
from pmviewer.render.free_camera import resolve_view
from pmviewer.render.planes import CHANNELS, PLANES
from pmviewer.scene.analysis import SceneTraits
from pmviewer.scene.description import Camera, Scene
from pmviewer.settings.access import Settings

SIZE = 64
N_PHOTONS = 4000


@dataclass(frozen=True)
class Triangles:
    vertices: np.ndarray
    normals: np.ndarray
    albedo: np.ndarray
    center: np.ndarray
    radius: float


def room() -> Triangles:
    """The floor, the back wall and a quad in front of the wall that hides part of it; the camera looks along −z."""

    def quad(corner, u, v, colour):
        corner, u, v = (np.array(x, float) for x in (corner, u, v))
        points = [corner, corner + u, corner + u + v, corner, corner + u + v, corner + v]
        normal = np.cross(u, v)
        return points, [normal / np.linalg.norm(normal)] * 6, [colour] * 6

    parts = [
        quad((-1, -1, 1), (2, 0, 0), (0, 0, -2), (0.7, 0.7, 0.7)),
        quad((-1, -1, -1), (2, 0, 0), (0, 2, 0), (0.6, 0.2, 0.2)),
        quad((-0.9, -0.9, 0), (0.8, 0, 0), (0, 1.8, 0), (0.2, 0.6, 0.2)),
    ]
    stacked = [np.concatenate([np.asarray(p[i], float) for p in parts]).astype(np.float32) for i in range(3)]
    return Triangles(*stacked, center=np.zeros(3), radius=1.75)


def encode(powers: np.ndarray) -> np.ndarray:
    """float32 → the 16-bit codes of stored powers."""
    bits = powers.astype(np.float32).view(np.uint32)
    return np.where(powers > 0, np.minimum((bits + 0x1000 - (80 << 23)) >> 13, 0xFFFF), 0).astype(np.uint32)


def photons_at(positions: np.ndarray, colour=(1.0, 1.0, 1.0), bounces: int = 2, light: int = 0) -> np.ndarray:
    """Stored photons (n, 6) of one colour at these positions (n, 3)."""
    photons = np.zeros((len(positions), 6), np.float32)
    photons[:, :3] = positions
    words = photons.view(np.uint32)
    red, green, blue = encode(np.array(colour, np.float32))
    words[:, 3] = bounces
    words[:, 4] = red | (green << 16)
    words[:, 5] = blue | np.uint32(light << 16)
    return photons


def wall_photons() -> np.ndarray:
    """A regular pattern on the back wall."""
    side = int(np.sqrt(N_PHOTONS))
    x, y = np.meshgrid(np.linspace(-0.95, 0.95, side), np.linspace(-0.95, 0.95, side))
    return np.stack([x.ravel(), y.ravel(), np.full(x.size, -1.0)], axis=1)


def picture_planes(rng: np.random.Generator) -> np.ndarray:
    planes = np.zeros((SIZE, SIZE, CHANNELS), np.float32)
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    planes[..., PLANES["direct"]] = np.stack([x, y, 1 - x], axis=-1) * 1.5
    planes[..., PLANES["caustic"]] = rng.uniform(0, 0.2, (SIZE, SIZE, 3))
    planes[..., PLANES["albedo"]] = (0.7, 0.4, 0.2)
    planes[..., PLANES["normal"]] = (0.0, 0.0, 1.0)
    planes[..., PLANES["depth"]] = (2 + 3 * y)[..., None]
    return planes


class FakeSession:
    def __init__(self, settings: Settings | None = None) -> None:
        self.on_update: Callable[[], None] | None = None
        self.settings = settings or Settings()
        self.sets: list[Settings] = []
        self.opened: list[str] = []
        self.scene: Scene | None = None
        self.scene_path = ""
        self.traits: SceneTraits | None = None
        self.geometry: Triangles | None = None
        self.frame: Frame | None = None
        self.is_newest = True
        self.status = Status()
        self.opened_scene = None
        self.loading = ""
        self.ahead = ""
        self.stops_ahead = 0
        self.threads = self.workers = None
        self.paused = False
        self.restarts = 0
        self.stops = 0
        self.version = 1
        self.closed = False
        self.film: Path | None = None
        self.film_file: Path | None = None
        self.inspected: tuple[int, int] | None = None
        self.pinned = None
        self._messages: list[Message] = []

    def cancel_loading(self) -> None:
        self.loading = ""

    def stop_compiling_ahead(self) -> None:
        self.stops_ahead += 1
        self.ahead = ""

    def autosave(self, path: Path | None) -> None:
        self.film_file = path

    def open(self, source: str | Path, settings: Settings | None = None, parameters=None, film=None) -> None:
        self.opened.append(str(source))
        self.film = film
        if "broken" in str(source):
            self._messages.append(Message("error", f"{source}:3: unknown shape 'blob'. Use sphere, cube or obj."))
            return
        self.scene_path = str(source)
        camera = Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 40.0)
        self.scene = Scene(Path(source).stem, None, (), (), (), camera, SIZE, SIZE)
        self.traits = SceneTraits(True, True, False, False, 1)
        self.geometry = room()
        if settings is not None:
            self.settings = settings
        self._messages.append(Message("info", f"opened {source}"))
        self.publish()

    def publish(self, planes: np.ndarray | None = None, coarse: bool = False) -> None:
        serial = self.frame.serial + 1 if self.frame else 1
        clouds = {
            "caustic": PhotonCloud(photons_at(wall_photons(), (1.0, 0.1, 0.1)), 1e-3),
            "global": PhotonCloud(photons_at(wall_photons() * 0.5 + (0, 0, 0.5), (0.1, 0.1, 1.0), 3, 1), 1e-3),
        }
        stored = {name: len(c.photons) for name, c in clouds.items()}
        assert self.scene is not None
        statistics = Statistics(
            passes=serial,
            emitted=200_000 * serial,
            stored={name: n * serial for name, n in stored.items()},
            stored_in_pass=stored,
            radius={"global": 0.0081, "caustic": 0.00405},
            rays=14_200_000 * serial,
            seconds=0.9 * serial,
            cpu_seconds=1.7 * serial,
            stage_seconds={"photons": 0.31, "maps": 0.12, "image": 1.2, "film": 0.02},
            map_bytes=24 * sum(stored.values()),
            bytes_per_photon=25.6,
            dropped={"film": 0},
            energy=Energy(serial, (12.0, 9.0, 2.5, 0.5, 0.0), (0.0, 0.06, 0.06, 0.01, 0.0)),
            skipped=(("volume photons", "no participating media in the scene"),),
        )
        self.frame = Frame(
            serial=serial,
            version=self.version,
            coarse=coarse,
            planes=picture_planes(np.random.default_rng(0)) if planes is None else planes,
            settings=self.settings,
            camera=resolve_view(self.scene, self.settings, self.geometry.center, self.geometry.radius),
            statistics=statistics,
            clouds=clouds,
            scene_name=self.scene.name,
            automatic={"estimate.radius": 0.0081, "photons.projection": "off", "light.rig": "file"},
        )
        self.status = Status("paused" if self.paused else "rendering", "", serial, serial / 1024)
        if self.on_update:
            self.on_update()

    def set(self, settings: Settings) -> None:
        self.sets.append(settings)
        self.settings = settings
        if self.scene is not None:
            self.publish()

    def pause(self) -> None:
        self.paused = True

    def resume(self) -> None:
        self.paused = False

    def stop(self) -> None:
        self.paused = True
        self.stops += 1

    def restart(self) -> None:
        self.restarts += 1

    def inspect(self, pixel: tuple[int, int] | None) -> None:
        self.inspected = pixel

    def pin(self, pinned) -> None:
        self.pinned = pinned

    def take_messages(self) -> list[Message]:
        taken, self._messages = self._messages, []
        return taken

    def close(self) -> None:
        self.closed = True
