"""The live page: viser's server, its sliders, and the one thread that moves the mechanism.

Callbacks only note requests; one worker runs the latest request of each kind and draws. So fast
input never makes a queue, no pose can stop the page, and state needs no locks.
"""

from __future__ import annotations

import contextlib
import io
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import viser
import xarray as xr

from ..analysis.map.map_files import open_map
from ..errors import CondyleError, InputError, brief
from ..mechanism import Mechanism, as_mechanism
from ..report.scene import trails
from ..results.solution import as_kind, open_solution
from .controls import ControlPanel
from .gate import Gate, guarded
from .live_player import LivePlayer
from .map_layer import MapLayer
from .playback import Playback
from .session import Session
from .snapshot import Snapshot
from .stage import Stage
from .uploads import UploadWatch

if TYPE_CHECKING:
    from ..simulation import Scenario

DEFAULT = "masticatory"
BRAND = (16, 93, 202)
FRAME = 1 / 30  # seconds between pictures of a solution that plays
IDLE = 10.0  # seconds between looks at uploads, where nothing plays


class View:
    """A running page: `url` is its address; `close` ends it.

    Attributes: session: the pose and the load that people move;  playback: a solution or a
                simulation that the page shows, or None;  live: the simulation, if there is one;
                snapshot: what is shown now;  port: that was free.
    """

    session: Session
    stage: Stage
    panel: ControlPanel
    snapshot: Snapshot

    def __init__(
        self,
        mechanism: Mechanism,
        solution: xr.Dataset | None = None,
        host: str = "127.0.0.1",
        port: int = 8080,
        dataset: xr.Dataset | None = None,
        live: LivePlayer | None = None,
    ) -> None:
        """Start serving. Raises: MechanismError: if the contacts do not hold the platform."""
        session = Session(mechanism)
        self._server, gate = server_of(host, port)
        self.set_dark(False)
        # Pictures of rooms would come from the network.
        self._server.scene.configure_environment_map(None)
        self.host: str = host
        self._token = gate.token
        self.port: int = self._server.get_port()
        self._requests: dict[str, Callable[[], None]] = {}
        self._noting = threading.Lock()
        self._wake = threading.Event()
        self._uploads = UploadWatch(self._server)
        self._closed = False
        self.dragging = False
        self.live = live
        self.playback: Playback | LivePlayer | None = live
        self.map: MapLayer | None = None
        self._enter(session)
        if solution is not None:
            self.play_solution(solution)
        if dataset is not None:
            self.show_map(dataset)
        self._worker = threading.Thread(target=self._work, name="condyle-view", daemon=True)
        self._worker.start()
        self._wake.set()

    @property
    def url(self) -> str:
        """Where the page is, with the key without which it does not answer."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}/{self._token}/"

    def request(self, kind: str, action: Callable[[], None]) -> None:
        """Let the worker call `action` soon; it replaces an earlier request of the same kind.

        A CondyleError that it raises is shown on the page.
        """
        with self._noting:
            self._requests.pop(kind, None)  # the latest request goes last
            self._requests[kind] = action
        self._wake.set()

    def open_mechanism(self, mechanism: Mechanism) -> None:
        """Show another mechanism, at home; for the worker.

        Raises: CondyleError: if it cannot be; the page keeps what it had.
        """
        session = Session(mechanism)  # before anything is cleared
        self.playback = self.live = None
        self._enter(session)

    def play_solution(self, solution: xr.Dataset) -> None:
        """Show a solution and its mechanism, at its first sample; for the worker."""
        playback = Playback(solution)
        if playback.mechanism != self.session.mechanism:
            self.live = None
            self._enter(Session(playback.mechanism))
        self.playback = playback
        self.stage.show_paths([playback.path(point) for _, point in trails(solution)])
        has = "marker_body" in solution.coords
        self.stage.show_markers([str(b) for b in solution["marker_body"].values] if has else [])
        self.panel.show_playback(playback)

    def show_map(self, dataset: xr.Dataset) -> None:
        """Show a map beside its mechanism, which goes where the map is clicked; for the worker."""
        mechanism = dataset.condyle.mechanism
        if mechanism != self.session.mechanism:
            self._enter(Session(mechanism))
        self.map = MapLayer(self._server.scene, self.stage.centre, self.session.model, dataset)
        self.map.on_click(lambda q: self.request("map", partial(self.panel.take, q)))

    def set_dark(self, dark: bool) -> None:
        """Draw the page dark or light."""
        self.dark = dark
        self._server.gui.main_panel.dock_right()
        self._server.gui.configure_theme(
            control_width="large",
            dark_mode=dark,
            show_logo=False,
            show_share_button=False,  # it would go through a server elsewhere
            brand_color=BRAND,
        )

    def look_from(self, name: str) -> None:
        """Turn the cameras of everyone who looks to a view of `stage.VIEWS`."""
        for client in self._server.get_clients().values():
            self.stage.look_from(client.camera, name)

    def close(self) -> None:
        """Stop serving."""
        self._closed = True
        self._wake.set()
        self._worker.join(timeout=5)
        self._server.stop()

    def _enter(self, session: Session) -> None:
        """Build scene and panel for a session's mechanism."""
        if hasattr(self, "stage"):
            self.stage.remove()
            self._server.gui.reset()
        self.session = session
        self.map = None
        self.stage = Stage(self._server, session.mechanism)
        self.stage.look_from(self._server.initial_camera)
        for client in self._server.get_clients().values():
            self.stage.look_from(client.camera)
        self.panel = ControlPanel(self._server, self)
        self.snapshot = session.snapshot()

    def _work(self) -> None:
        before = time.monotonic()
        while not self._closed:
            playing = self.playback is not None and self.playback.playing
            self._wake.wait(FRAME if playing else IDLE)
            woken = self._wake.is_set()
            self._wake.clear()
            now = time.monotonic()
            self._uploads.look(now)
            # Time spent waiting for a hand is no time of the solution.
            passed = now - before if playing else 0.0
            before = now
            try:
                moved = self.playback is not None and self.playback.advance(passed)
                self._run_requests()
                if woken or moved:
                    self._draw()
            except CondyleError as error:
                self.panel.show_error(str(error))
            except Exception as error:  # the page must say it and go on
                self.panel.show_error(
                    f"This cannot be shown ({type(error).__name__} inside condyle, please report "
                    "it). The page goes on with what it had."
                )

    def _run_requests(self) -> None:
        with self._noting:
            requests, self._requests = self._requests, {}
        for action in requests.values():
            action()

    def _draw(self) -> None:
        self.snapshot = (self.playback or self.session).snapshot()
        with self._server.atomic():
            self.stage.show(self.snapshot, self.dragging)
            self.panel.show(self.snapshot)
            if self.map is not None:
                self.map.show(self.snapshot.pose)


def server_of(host: str, port: int) -> tuple[viser.ViserServer, Gate]:
    """viser's server behind a gate; nobody passes who has not its token."""
    gate = Gate(host)
    # viser greets in its own name.
    with contextlib.redirect_stdout(io.StringIO()), guarded(gate):
        return viser.ViserServer(host=host, port=port, label="condyle", verbose=False), gate


def open_view(
    mechanism: Mechanism | str | Path | None = None,
    solution: xr.Dataset | str | Path | None = None,
    host: str = "127.0.0.1",
    port: int = 8080,
    map: xr.Dataset | str | Path | None = None,
    scenario: Scenario | Mapping[str, Any] | str | Path | None = None,
) -> View:
    """Start the page and return at once; see `serve_view`."""
    if scenario is not None and (solution is not None or map is not None):
        raise InputError("a page that simulates a scenario shows no solution and no map beside it")
    if isinstance(map, str | Path):
        map = open_map(map)
    elif map is not None:
        as_kind(map, "map", "map")
    if map is not None and map["status"].ndim == 1:
        raise InputError("this map goes over one coordinate; the view shows those of two or three")
    if map is not None and solution is None:
        mechanism = map.condyle.mechanism
    if isinstance(solution, str | Path):
        solution = open_solution(solution)
    elif solution is not None:
        as_kind(solution, "solution", "solution")
    if mechanism is None:
        mechanism = DEFAULT if solution is None else solution.condyle.mechanism
    mechanism = as_mechanism(mechanism)
    if not isinstance(host, str) or not host.isprintable() or not host.isascii():
        raise InputError(f"host: expected the name or address of this machine, got {brief(host)}")
    if not isinstance(port, int) or isinstance(port, bool) or not 0 <= port < 2**16:
        raise InputError(f"port: expected a number from 0 to 65535, got {brief(port)}")
    live = None
    if scenario is not None:
        from ..simulation.simulating import planned

        live = LivePlayer(planned(mechanism, [scenario])[0])
    return View(mechanism, solution, host, port, map, live)


def serve_view(
    mechanism: Mechanism | str | Path | None = None,
    solution: xr.Dataset | str | Path | None = None,
    host: str = "127.0.0.1",
    port: int = 8080,
    open_browser: bool = False,
    map: xr.Dataset | str | Path | None = None,
    scenario: Scenario | Mapping[str, Any] | str | Path | None = None,
) -> None:
    """Serve the live page until interrupted.

    Args:   mechanism: one, the path of its file, or the name of a bundled one; without, that of
                the solution, or the chewing robot.
            solution: to play back, or the path of its NetCDF file; its own mechanism is shown.
            host, port: of the server; if `port` is in use, the next free one.
            open_browser: show the page at once.
            map: of `workspace_map`, or the path of its file: shown beside its mechanism, which
                goes where the map is clicked.
            scenario: to simulate while the page is open, as of `condyle.simulate`, or its file.
    Raises: CondyleError: if mechanism, solution, map or scenario cannot be used.
    """
    view = open_view(mechanism, solution, host, port, map, scenario)
    if view.port != port and port:
        print(f"condyle view: port {port} is in use; took {view.port}", flush=True)
    print(f"condyle view: {view.url} (stop with Ctrl-C)", flush=True)
    if open_browser:
        import webbrowser

        webbrowser.open(view.url)
    with contextlib.suppress(KeyboardInterrupt):
        while True:
            time.sleep(3600)
    view.close()
