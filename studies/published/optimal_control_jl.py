"""OptimalControlProblems.jl: the 28 problems of control-toolbox, and the dymos examples from which six of them come.

A problem is stated twice in the package (``ext/OptimalControlModels``, ``ext/JuMPModels``). Its page in the
documentation (``dev/problems/*.html``) solves both by trapezoids on 200 to 500 intervals and prints the objective:
its six digits are the values here. Balanced field, cannonball, mountain car, Robertson, SSTO and water rocket follow
dymos, most of them shortened to one phase; dymos' own examples are listed next to them, with the values that its
documentation asserts to within a relative 1e-4 to 5e-2.
"""

from __future__ import annotations

from functools import partial

from mathnavi.studies.published import dymos_flights
from mathnavi.studies.published import optimal_control_jl_flights as flights
from mathnavi.studies.published import optimal_control_jl_mechanics as mechanics
from mathnavi.studies.published import optimal_control_jl_processes as processes
from mathnavi.studies.published import optimal_control_jl_vehicles as vehicles
from mathnavi.studies.published.optimum import PublishedOptimum

PAGES = "OptimalControlProblems.jl, documentation, dev/problems"
MODELS = "OptimalControlProblems.jl, ext/OptimalControlModels"
DYMOS = "dymos, docs/dymos_book/examples"

PUBLISHED: dict[str, PublishedOptimum] = {
    "OptimalControl.jl: balanced field": PublishedOptimum(
        "771.011",
        f"{PAGES}/balanced_field.html",
        flights.balanced_field,
        771.007819638,
        "Radau IIA and Gauss-Legendre of 5 points on 2 arcs, 6 and 12 intervals each",
        quantity="r(T)",
        note="take-off climb alone, from V_1",
    ),
    "OptimalControl.jl: beam": PublishedOptimum(
        "8.88928", f"{PAGES}/beam.html", independent=8.0 / 0.9, evidence="closed form: 8 / (9 L)", same_as="Bocop: beam"
    ),
    "OptimalControl.jl: bioreactor": PublishedOptimum(
        "-12.9257",
        f"{PAGES}/bioreactor.html",
        processes.bioreactor,
        singular=True,
        note="20 days, as on the page; Bocop has 30. Four independent transcriptions lie between -12.9243 and -12.9254",
    ),
    "OptimalControl.jl: brachistochrone": PublishedOptimum(
        "1.80293", f"{PAGES}/brachistochrone.html", quantity="T", same_as="collection: brachistochrone, drop"
    ),
    "OptimalControl.jl: Bryson-Denham": PublishedOptimum(
        "4.00014", f"{PAGES}/bryson_denham.html", same_as="collection: Bryson-Denham"
    ),
    "OptimalControl.jl: cannonball": PublishedOptimum(
        "",
        f"{MODELS}/cannonball.jl",
        flights.cannonball,
        3196.6197914,
        "the two numbers that are to be chosen by Nelder and Mead, DOP853",
        quantity="r(T)",
        sign=-1.0,
        note="no page, no value",
    ),
    "OptimalControl.jl: cart pendulum": PublishedOptimum(
        "1.74397",
        f"{PAGES}/cart_pendulum.html",
        mechanics.cart_pendulum,
        1.743937,
        "Radau IIA and Gauss-Legendre of 2 points, 1200 intervals: to 1e-6",
        singular=True,
        quantity="T",
        note="the package's equations, which are not those of a cart with a pendulum: see the statement",
    ),
    "OptimalControl.jl: chain": PublishedOptimum("5.06858", f"{PAGES}/chain.html", same_as="collection: hanging chain"),
    "OptimalControl.jl: dielectrophoretic particle": PublishedOptimum(
        "7.81132",
        f"{PAGES}/dielectrophoretic_particle.html",
        mechanics.dielectrophoretic_particle,
        7.8113113343,
        "Radau IIA and Gauss-Legendre of 5 points on 3 arcs, 12 intervals each",
        quantity="T",
    ),
    "OptimalControl.jl: double oscillator": PublishedOptimum(
        "0.000910923",
        f"{PAGES}/double_oscillator.html",
        mechanics.double_oscillator,
        9.1103486302e-4,
        "Radau IIA and Gauss-Legendre of 5 points, 40 intervals",
    ),
    "OptimalControl.jl: ducted fan": PublishedOptimum(
        "1831.83",
        f"{PAGES}/ducted_fan.html",
        vehicles.ducted_fan,
        1831.60939,
        "Gauss-Legendre of 5 points on 23 arcs; of 3 points, 200 intervals: to 4e-9",
    ),
    "OptimalControl.jl: electric vehicle": PublishedOptimum(
        "1228.6",
        f"{PAGES}/electric_vehicle.html",
        vehicles.electric_vehicle,
        1228.58028989,
        "Radau IIA and Gauss-Legendre of 5 points, 40 intervals",
        note="the page is for b1 = b2 = 1; ext/electrical_vehicle.jl had 1000",
    ),
    "OptimalControl.jl: glider": PublishedOptimum("-1247.98", f"{PAGES}/glider.html", same_as="COPS: glider"),
    "OptimalControl.jl: insurance": PublishedOptimum(
        "-2.05921",
        f"{PAGES}/insurance.html",
        processes.insurance,
        -2.05993472,
        "Radau IIA and Gauss-Legendre of 5 points on 4 arcs, the singular one quadratic",
        singular=True,
    ),
    "OptimalControl.jl: Jackson": PublishedOptimum(
        "-0.191822",
        f"{PAGES}/jackson.html",
        processes.jackson,
        -0.191814356325,
        "Radau IIA and Gauss-Legendre of 5 points on 3 arcs, the singular one quadratic",
        singular=True,
    ),
    "OptimalControl.jl: moonlander": PublishedOptimum(
        "0.96181",
        f"{PAGES}/moonlander.html",
        vehicles.moonlander,
        0.961797546,
        "Radau and Gauss-Legendre, 30 x 6, controls of degree 0, moving",
        quantity="T",
    ),
    "OptimalControl.jl: mountain car": PublishedOptimum(
        "102.398",
        f"{PAGES}/mountain_car.html",
        mechanics.mountain_car,
        102.367535879,
        "Radau IIA and Gauss-Legendre of 5 points on 3 arcs, 16 intervals each",
        quantity="T",
    ),
    "OptimalControl.jl: quadrotor": PublishedOptimum(
        "",
        f"{MODELS}/quadrotor.jl",
        vehicles.quadrotor,
        1.49214,
        "Radau IIA and Gauss-Legendre of 3 points, 200 intervals: to 2e-6",
        note="no page that was computed, no value",
    ),
    "OptimalControl.jl: Robbins": PublishedOptimum(
        "19.4666",
        f"{PAGES}/robbins.html",
        independent=19.43178195,
        evidence="cubic controls between 1, 2, 3 and 4 contacts, Radau IIA and Gauss-Legendre of 5 points",
        same_as="Bocop: robbins",
        note="trapezoids on 500 intervals miss the contacts: 0.2% above the optimum",
    ),
    "OptimalControl.jl: Robertson": PublishedOptimum(
        "",
        f"{MODELS}/robertson.jl",
        processes.robertson,
        0.28416374574,
        "Radau, BDF and LSODA of SciPy, relative tolerance 1e-12",
        quantity="z(T)",
        sign=-1.0,
        note="an initial value problem: no value, and no control that acts",
    ),
    "OptimalControl.jl: robot": PublishedOptimum(
        "9.14113", f"{PAGES}/robot.html", quantity="T", same_as="collection: robot arm"
    ),
    "OptimalControl.jl: rocket": PublishedOptimum(
        "-1.01284", f"{PAGES}/rocket.html", origin=-1.0, singular=True, same_as="collection: Goddard"
    ),
    "OptimalControl.jl: space shuttle": PublishedOptimum(
        "0.595875",
        f"{PAGES}/space_shuttle.html",
        vehicles.space_shuttle,
        0.595876076294,
        "Radau IIA and Gauss-Legendre of 5 points, 60 and 100 intervals",
        quantity="θ(T)",
        sign=-1.0,
    ),
    "OptimalControl.jl: SSTO": PublishedOptimum(
        "",
        f"{MODELS}/ssto_earth.jl",
        flights.single_stage_to_orbit,
        143.58972588,
        "Radau IIA and Gauss-Legendre of 5 and 7 points, 44 and 88 intervals",
        quantity="T",
        note="no page, no value",
    ),
    "OptimalControl.jl: steering": PublishedOptimum(
        "0.554572", f"{PAGES}/steering.html", quantity="T", same_as="collection: steering"
    ),
    "OptimalControl.jl: truck trailer": PublishedOptimum(
        "59.2303",
        f"{PAGES}/truck_trailer.html",
        vehicles.truck_trailer,
        note="trapezoids on 200 intervals of this statement give 59.230287, one of many local optima",
    ),
    "OptimalControl.jl: van der Pol": PublishedOptimum(
        "1.04781",
        f"{PAGES}/vanderpol.html",
        independent=1.04780690822,
        evidence="Radau IIA and Gauss-Legendre of 5 points, 40 intervals",
        same_as="Bocop: vanderpol",
    ),
    "OptimalControl.jl: water rocket": PublishedOptimum(
        "",
        f"{MODELS}/water_rocket.jl",
        flights.water_rocket,
        12.125823662,
        "the water that is gone at the longest T, and the steepest start, DOP853",
        quantity="h(T)",
        sign=-1.0,
        note="no page, no value; its metadata spell C_d what the model reads as Cd",
    ),
    "dymos: balanced field": PublishedOptimum(
        "2197.7",
        f"{DYMOS}/balanced_field/balanced_field.ipynb, to 1e-2",
        dymos_flights.balanced_field,
        2196.69596,
        "Radau IIA and Gauss-Legendre of 3 points, 80 and 160 intervals: to 2e-8",
        quantity="r(T)",
    ),
    "dymos: cannonball": PublishedOptimum(
        "3183.25",
        f"{DYMOS}/multi_phase_cannonball/multi_phase_cannonball.ipynb, to 1e-2",
        dymos_flights.cannonball,
        3183.3758314,
        "the two numbers that are to be chosen by Nelder and Mead, DOP853",
        quantity="r(T)",
        sign=-1.0,
        note="dymos interpolates the atmosphere linearly in a table",
    ),
    "dymos: mountain car": PublishedOptimum(
        "102.479",
        f"{DYMOS}/mountain_car/mountain_car.ipynb, to 5e-3",
        quantity="T",
        same_as="OptimalControl.jl: mountain car",
    ),
    "dymos: Robertson": PublishedOptimum(
        "0.2841592",
        f"{DYMOS}/robertson_problem/robertson_problem.ipynb, to 1e-4",
        quantity="z(T)",
        sign=-1.0,
        same_as="OptimalControl.jl: Robertson",
    ),
    "dymos: SSTO": PublishedOptimum(
        "143",
        f"{DYMOS}/ssto_earth/ssto_earth.ipynb, to 5e-2",
        dymos_flights.single_stage_to_orbit,
        143.580538359,
        "Radau IIA of 5 and 7 points and Gauss-Legendre of 5, 44 and 88 intervals",
        quantity="T",
        note="dymos' drag has the square of each component of the speed, unlike its text",
    ),
    "dymos: water rocket, height": PublishedOptimum(
        "53.5",
        f"{DYMOS}/water_rocket/water_rocket.ipynb, to 1e-2",
        dymos_flights.water_rocket,
        54.148994852,
        "the two numbers that are to be chosen by Nelder and Mead, RK45 at 1e-11",
        quantity="h(T)",
        sign=-1.0,
        note="the design that dymos prints, 0.144 kg and 0.98 l, flies 53.45 m here too: it is no optimum",
    ),
    "dymos: water rocket, range": PublishedOptimum(
        "85.11",
        f"{DYMOS}/water_rocket/water_rocket.ipynb, to 1e-2",
        partial(dymos_flights.water_rocket, farthest=True),
        86.43696554,
        "the three numbers that are to be chosen by Nelder and Mead, RK45 at 1e-11",
        quantity="r(T)",
        sign=-1.0,
        note="the design that dymos prints, 0.189 kg, 1.026 l and 46 deg, flies 85.13 m here too: it is no optimum",
    ),
}
