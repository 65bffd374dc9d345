"""The web server: one session for each browser."""

import ctypes
import logging
import socket
import threading
from typing import Any

import viser

from app.cache import ResultCache
from app.session import Session
from app.web import adapter
from lessons.registry import Registry

log = logging.getLogger(__name__)


class App:
    """A running server.  `sessions` maps client ids to their sessions."""

    def __init__(self, registry: Registry, host: str = "127.0.0.1", port: int = 8080,
                 first_lesson: str | None = None, allowed_hosts: frozenset[str] = frozenset()) -> None:
        """Listens at once; port 0 takes any free one.  allowed_hosts: more names that requests may ask for."""
        self.registry = registry
        self.sessions: dict[int, Session] = {}
        self.connected = threading.Condition()
        self._cache = ResultCache()
        self._first_lesson = first_lesson
        hosts = adapter.LOOPBACK | allowed_hosts | ({host} if host not in ("0.0.0.0", "::") else frozenset())
        self.server: viser.ViserServer = adapter.start_server(host, port, hosts)
        self.port: int = self.server.get_port()
        self.host = host
        self.server.on_client_connect(self._joined)
        self.server.on_client_disconnect(self._left)

    @property
    def url(self) -> str:
        return f"http://{'127.0.0.1' if self.host in ('0.0.0.0', '::') else self.host}:{self.port}"

    def wait_for_session(self, timeout: float) -> Session:
        """The first browser's session; TimeoutError when none comes."""
        with self.connected:
            if not self.connected.wait_for(lambda: self.sessions, timeout):
                raise TimeoutError(f"no browser connected within {timeout:g} s")
            return next(iter(self.sessions.values()))

    def stop(self) -> None:
        for session in list(self.sessions.values()):
            session.close()
        self.server.stop()

    async def _joined(self, client: viser.ClientHandle) -> None:
        adapter.prepare_client(client)
        with self.connected:
            self.sessions[client.client_id] = Session(client, self.registry, self._cache, self._first_lesson)
            self.connected.notify_all()

    async def _left(self, client: viser.ClientHandle) -> None:
        with self.connected:
            session = self.sessions.pop(client.client_id, None)
            empty = not self.sessions
        if session is not None:
            session.close()
        if empty:
            threading.Thread(target=_return_memory, name="trim", daemon=True).start()


def free_port(host: str, wanted: int) -> int:
    """The first port from `wanted` on that can be listened to; OSError when there is none among the next 100."""
    for port in range(wanted, min(wanted + 100, 65536)):
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((host, port))
            except OSError:
                continue
            return port
    raise OSError(f"no free port from {wanted} to {wanted + 99} on {host}")


def _return_memory(*_: Any) -> None:
    """Give freed memory back to the system; figures of many clients leave gigabytes behind otherwise."""
    try:
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    except (OSError, AttributeError):
        log.debug("malloc_trim is not available here")
