"""COPS 3: the twelve problems of the constrained optimisation problem set that are optimal control or fitting.

E. D. Dolan, J. J. Moré and T. S. Munson, Benchmarking Optimization Software with COPS 3.0, ANL/MCS-TM-273, 2004. Its
tables hold the optima of *discretised* problems; the values here are those that COPSBenchmark.jl quotes from the report
in ``test/runtests.jl``, with the number of intervals that they belong to.
"""

from __future__ import annotations

from mathnavi.studies.published.cops_fitting import gasoil, marine, methanol, pinene
from mathnavi.studies.published.cops_paths import camshape, catmix, chain, channel, glider, robot, rocket, steering
from mathnavi.studies.published.optimum import PublishedOptimum

REPORT = "COPS 3 report (ANL/MCS-TM-273, 2004), quoted in COPSBenchmark.jl, test/runtests.jl"
SHOOTING = "single shooting, by DOP853 from five starts and by Radau IIA; bounded least squares"

PUBLISHED: dict[str, PublishedOptimum] = {
    "COPS: camshape": PublishedOptimum(
        "4.2791",
        f"{REPORT}: 1000 points",
        camshape,
        independent=4.2728604777,
        evidence="closed form: 5/2 ∫ r dθ with r = 1 / cos θ to sin θ = (√10 - 1) / 3, then slope 3/2 to r = 2",
        quantity="area",
        sign=-1.0,
        note="stated for infinitely many points; the best of n points is 4.28415 for 100, 4.27850 for 200 and 4.27399 "
        "for 1000, for which the file itself calls its value slightly different",
    ),
    "COPS: chain": PublishedOptimum(
        "5.06891",
        f"{REPORT}: 800 variables, 199 intervals",
        chain,
        independent=5.0684801110,
        evidence="closed form: a catenary; see benchmarks.ocp_references",
        note="the problem 'hanging chain' of the collection, stated again",
    ),
    "COPS: pinene": PublishedOptimum(
        "19.8721",
        f"{REPORT}: 100 intervals",
        pinene,
        independent=19.872166934,
        evidence="matrix exponentials, least squares from three starts",
    ),
    "COPS: marine": PublishedOptimum(
        "1.97462e7",
        f"{REPORT}: 100 intervals",
        marine,
        independent=19746529.716,
        evidence="matrix exponentials, y(0) eliminated, least squares from four starts",
        note="printed for the midpoint rule with 100 intervals",
    ),
    "COPS: channel": PublishedOptimum(
        "1.0",
        f"{REPORT}: 200 intervals",
        channel,
        independent=1.0,
        evidence="by definition: the cost is a constant",
        note="a boundary value problem without a control: whether it is solved is all that counts",
    ),
    "COPS: robot": PublishedOptimum(
        "9.14138",
        f"{REPORT}: 200 intervals",
        robot,
        independent=9.1409117459,
        evidence="Radau IIA and Gauss-Legendre on six arcs; see benchmarks.ocp_references",
        quantity="T",
        note="the problem 'robot arm' of the collection, stated again",
    ),
    "COPS: steering": PublishedOptimum(
        "0.554577",
        f"{REPORT}: 200 intervals",
        steering,
        independent=0.55457087833,
        evidence="closed form: the linear tangent law; see benchmarks.ocp_references",
        quantity="T",
        note="the problem 'steering' of the collection, stated again",
    ),
    "COPS: rocket": PublishedOptimum(
        "1.01283",
        f"{REPORT}: 400 intervals",
        rocket,
        independent=1.0128369183,
        evidence="Radau IIA and Gauss-Legendre on three arcs; see benchmarks.ocp_references",
        quantity="h(T)",
        sign=-1.0,
        origin=1.0,
        singular=True,
        note="the problem 'Goddard' of the collection, stated again",
    ),
    "COPS: glider": PublishedOptimum(
        "1255.05",
        f"{REPORT}: 100 intervals",
        glider,
        independent=1247.9876008,
        evidence="Radau IIA, 98 x 6, and Gauss-Legendre, 127 x 6, on three arcs",
        quantity="x(T)",
        sign=-1.0,
        note="printed for the trapezoidal rule with 100 intervals",
    ),
    "COPS: gasoil": PublishedOptimum(
        "5.2366e-3", f"{REPORT}: 100 intervals", gasoil, independent=5.2365958339e-3, evidence=SHOOTING
    ),
    "COPS: methanol": PublishedOptimum(
        "9.02229e-3",
        f"{REPORT}: 100 intervals",
        methanol,
        independent=9.0222898512e-3,
        evidence=SHOOTING,
        note="θ5 is 0, on its bound",
    ),
    "COPS: catmix": PublishedOptimum(
        "-4.80556e-2",
        f"{REPORT}: 100 intervals",
        catmix,
        independent=-0.048055685861,
        evidence="Radau IIA and Gauss-Legendre on three arcs; see benchmarks.ocp_references",
        singular=True,
        note="the problem 'catalyst mixing' of the collection, stated again",
    ),
}
