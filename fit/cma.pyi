# What the fits use of the library `cma`, which has no types.
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

class BestSolution:
    x: NDArray[np.float64]
    f: float
    def update(
        self, arx: Sequence[NDArray[np.float64]], *, arf: Sequence[float]
    ) -> BestSolution: ...

class CMAEvolutionStrategy:
    best: BestSolution
    countiter: int
    sigma: float
    def __init__(
        self, x0: NDArray[np.float64], sigma0: float, inopts: Mapping[str, object]
    ) -> None: ...
    def ask(self) -> list[NDArray[np.float64]]: ...
    def tell(
        self, solutions: Sequence[NDArray[np.float64]], function_values: Sequence[float]
    ) -> None: ...
    def stop(self) -> Mapping[str, object]: ...
    def pickle_dumps(self) -> bytes: ...
