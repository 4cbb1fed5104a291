"""Who may open the page: decided for every request before anything is answered.

* The name in the address (`Host`) must be one of this machine's loopback names while the page is served on loopback: a
  name of somebody else's that was made to point here (DNS rebinding) is refused. Any port will do, so ssh can forward.
* A connection for data (websocket) must come from the page itself: its `Origin` is the address that it asks for. What
  other pages in the same browser ask for is refused, and so is what says nothing of where it comes from.
* Where the page is served wider, every request needs the token: once in the address (`?token=...`), from then on as a
  cookie that other pages cannot send.
"""

import hmac
import ipaddress
import secrets
from collections.abc import Callable, Mapping
from http import HTTPStatus
from urllib.parse import parse_qs, urlsplit


def is_loopback(host: str) -> bool:
    """Whether an address to serve on is this machine alone."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(24)


class Gate:
    """Judges requests. ``token`` None: no token is needed."""

    def __init__(self, loopback_only: bool, token: str | None) -> None:
        if not loopback_only and not token:
            raise ValueError("what is served wider than loopback needs a token")
        self.loopback_only, self.token = loopback_only, token
        self.cookie = "turnbuckle_token"

    def judge(self, path: str, headers: Mapping[str, str]) -> str | None:
        """Why a request is refused, None where it may pass. ``headers`` must ignore the case of names."""
        name = _name(headers.get("Host", ""))
        if not name:
            return "the request does not say which host it means"
        if self.loopback_only and not is_loopback(name):
            return f"the page is for this machine alone, not for {name}"
        upgrade = headers.get("Upgrade", "").lower() == "websocket"
        origin = headers.get("Origin")
        if upgrade and origin is None:
            return "the request does not say which page it comes from"
        if origin is not None and urlsplit(origin).netloc.lower() != headers.get("Host", "").lower():
            return f"the request comes from another page, {origin}"
        if self.token is not None and not self._has_token(path, headers):
            return "the token is missing or wrong; open the address that turnbuckle printed"
        return None

    def greeting(self, path: str) -> str | None:
        """The cookie to set for a request that brought the token in its address."""
        if self.token is None or not self._in_address(path):
            return None
        return f"{self.cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict"

    def _has_token(self, path: str, headers: Mapping[str, str]) -> bool:
        if self._in_address(path):
            return True
        for part in headers.get("Cookie", "").split(";"):
            name, _, value = part.strip().partition("=")
            if name == self.cookie and self._same(value):
                return True
        return False

    def _in_address(self, path: str) -> bool:
        return any(self._same(value) for value in parse_qs(urlsplit(path).query).get("token", []))

    def _same(self, value: str) -> bool:
        assert self.token is not None
        return hmac.compare_digest(value.encode(), self.token.encode())


def _name(host: str) -> str:
    """The name in a `Host` header, without its port."""
    try:
        return (urlsplit(f"//{host}").hostname or "").lower()
    except ValueError:
        return ""


Respond = Callable[[HTTPStatus, str], object]


def refusal(reason: str) -> tuple[HTTPStatus, str]:
    """Status and text of an answer that refuses."""
    return HTTPStatus.FORBIDDEN, f"Turnbuckle: {reason}.\n"
