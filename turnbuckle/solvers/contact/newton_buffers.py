"""Arrays of the Newton solver on its device, kept between calls while problems keep their size."""

import numpy as np
import scipy.sparse as sp
import warp as wp

from turnbuckle.compute.host import host, write
from turnbuckle.data.contact import ContactProblem
from turnbuckle.math.types import real
from turnbuckle.solvers.contact.newton_kernels import SCALARS, SIZES
from turnbuckle.solvers.contact.newton_search import SUMS

ROOM = 1.5  # arrays that turn out too short grow to this part of what is needed


class Buffers:
    """What the kernels read and write. ``grown`` counts the times that arrays changed places."""

    def __init__(self, device: str) -> None:
        self.device = device
        self.grown = 0
        self.sizes = wp.zeros(SIZES, dtype=int, device=device)
        self.scalars = wp.zeros(SCALARS, dtype=real, device=device)
        self.scale = wp.zeros(1, dtype=real, device=device)
        self.kept = wp.zeros(1, dtype=int, device=device)
        self.goal = wp.zeros(1, dtype=real, device=device)
        self.forcing = wp.zeros(1, dtype=real, device=device)
        self.shortest = wp.zeros(1, dtype=real, device=device)
        self.least = wp.zeros(1, dtype=real, device=device)
        self.zero = wp.zeros(1, dtype=real, device=device)
        self.length = wp.zeros(1, dtype=real, device=device)
        self._all = 0  # numbers in the list of all
        self._arrays: dict[str, wp.array] = {}

    def __getattr__(self, name: str) -> wp.array:
        try:
            return self.__dict__["_arrays"][name]
        except KeyError:
            raise AttributeError(name) from None

    def take(self, problem: ContactProblem, tiles: int) -> None:
        """Take over a problem."""
        a, n = problem.a, problem.a.shape[0] // 3
        partner = np.full(n, -1, dtype=np.int32)
        partner[problem.pairs] = problem.pairs + 1
        partner[problem.pairs + 1] = problem.pairs
        fixed = np.zeros(n, np.uint8) if problem.fixed is None else problem.fixed.astype(np.uint8)
        self.put("starts", a.indptr, wp.int32)
        self.put("others", a.indices, wp.int32)
        self.put("a", a.data, wp.mat33d)
        self.put("partner", partner, wp.int32)
        self.put("fixed", fixed, wp.uint8)
        self.put("free", problem.free.reshape(-1, 3), wp.vec3d)
        self.put("load", (np.zeros((n, 3)) if problem.load is None else problem.load.reshape(-1, 3)), wp.vec3d)
        for name in ("v", "g", "residual", "z", "p", "q", "dv"):
            self._room(name, n, wp.vec3d)
        for name in ("local", "diagonal", "coupled", "m", "n"):
            self._room(name, n, wp.mat33d)
        self._room("miss", n, real)
        self._room("block_mark", n, wp.uint8)
        for name in ("some", "around", "some_parts"):
            self._room(name, n, wp.int32)
        self.take_rows(problem, tiles)

    def take_rows(self, problem: ContactProblem, tiles: int) -> None:
        """Take over the contacts of a problem whose matrix is here."""
        j, n, m = problem.j, problem.a.shape[0] // 3, problem.count
        transposed = sp.csr_array((np.arange(len(j.indices)), j.indices, j.indptr), shape=(m, n)).tocsc()
        self.put("offsets", j.indptr, wp.int32)
        self.put("columns", j.indices, wp.int32)
        self.put("j", j.data, wp.mat33d)
        self.put("t_offsets", transposed.indptr, wp.int32)
        self.put("jt", j.data[transposed.data], wp.mat33d)
        self.put("t_contacts", transposed.indices, wp.int32)
        self.put("floor", problem.floor, real)
        self.put("mu", problem.friction, real)
        for name in ("multiplier", "r", "y", "u", "du", "copy", "push"):
            self._room(name, m, wp.vec3d)
        self._room("d", m, wp.mat33d)
        for name in ("rho", "shift", "weight", "span", "missed", "lag", "stride", "primal", "wrong"):
            self._room(name, m, real)
        self._room("contact_mark", m, wp.uint8)
        self._room("theirs", m, wp.int32)
        self._room("all", max(n, m), wp.int32)
        if self._all != self._arrays["all"].shape[0]:
            self._all = self._arrays["all"].shape[0]
            self.write("all", np.arange(self._all))
        self._room("sums", tiles, real)
        self._room("stiffened", tiles, real)
        self._room("pq", tiles, real)
        for name, rows in (("errors", 3), ("slopes", SUMS)):
            if name not in self._arrays or self._arrays[name].shape[1] != tiles:
                self._arrays[name] = wp.zeros((rows, tiles), dtype=real, device=self.device)
                self.grown += 1
        self.write("sizes", np.array([n, m], dtype=np.int32))  # the region comes later

    def write(self, name: str, values: np.ndarray) -> None:
        """Values into the first places of an array."""
        write(getattr(self, name), values)

    def read(self, name: str, count: int) -> np.ndarray:
        """A copy of the first places of an array."""
        return np.array(host(getattr(self, name))[:count])

    def _room(self, name: str, count: int, kind: type) -> None:
        array = self._arrays.get(name)
        if array is None or array.shape[0] <= count:  # one more: loops run in four lanes, of which three count
            self._arrays[name] = wp.zeros(max(int(ROOM * count), 64), dtype=kind, device=self.device)
            if array is not None:  # what is kept must not depend on how large problems were before
                wp.copy(self._arrays[name], array, count=array.shape[0])
            self.grown += 1

    def put(self, name: str, values: np.ndarray, kind: type) -> None:
        """Values into an array that has room for them."""
        self._room(name, len(values), kind)
        self.write(name, values)
