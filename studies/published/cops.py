"""COPS 3: the twelve problems of the constrained optimisation problem set that are optimal control or fitting.

E. D. Dolan, J. J. Moré and T. S. Munson, Benchmarking Optimization Software with COPS 3.0, ANL/MCS-TM-273, 2004. Its
tables hold the optima of *discretised* problems; the values here are those that COPSBenchmark.jl quotes from the report
in ``test/runtests.jl``, with the number of intervals that they belong to.
"""

from __future__ import annotations

from mathnavi.studies.published.optimum import PublishedOptimum

REPORT = "COPS 3 report (ANL/MCS-TM-273, 2004), quoted in COPSBenchmark.jl, test/runtests.jl"

PUBLISHED: dict[str, PublishedOptimum] = {
    "COPS: camshape": PublishedOptimum("4.2791", f"{REPORT}: 1000 points", quantity="area", sign=-1.0),
    "COPS: chain": PublishedOptimum("5.06891", f"{REPORT}: 800 points", same_as="collection: hanging chain"),
    "COPS: pinene": PublishedOptimum("19.8721", f"{REPORT}: 100 intervals"),
    "COPS: marine": PublishedOptimum("1.97462e7", f"{REPORT}: 100 intervals"),
    "COPS: channel": PublishedOptimum("1.0", f"{REPORT}: 200 intervals", note="no cost: a boundary value problem, J = 1"),
    "COPS: robot": PublishedOptimum("9.14138", f"{REPORT}: 200 intervals", quantity="T", same_as="collection: robot arm"),
    "COPS: steering": PublishedOptimum(
        "0.554577", f"{REPORT}: 200 intervals", quantity="T", same_as="collection: steering"
    ),
    "COPS: rocket": PublishedOptimum(
        "1.01283", f"{REPORT}: 400 intervals", quantity="h(T)", sign=-1.0, origin=1.0, singular=True,
        same_as="collection: Goddard",
    ),
    "COPS: glider": PublishedOptimum("1255.05", f"{REPORT}: 100 intervals", quantity="x(T)", sign=-1.0),
    "COPS: gasoil": PublishedOptimum("5.2366e-3", f"{REPORT}: 100 intervals"),
    "COPS: methanol": PublishedOptimum("9.02229e-3", f"{REPORT}: 100 intervals"),
    "COPS: catmix": PublishedOptimum(
        "-4.80556e-2", f"{REPORT}: 100 intervals", singular=True, same_as="collection: catalyst mixing"
    ),
}  # fmt: skip
