"""OptimalControlProblems.jl: the 28 problems of control-toolbox, and the dymos examples from which six of them come.

A problem is stated twice in the package (``ext/OptimalControlModels``, ``ext/JuMPModels``). Its page in the
documentation (``dev/problems/*.html``) solves both by trapezoids on 200 to 500 intervals and prints the objective:
its six digits are the values here. Balanced field, cannonball, mountain car, Robertson, SSTO and water rocket follow
dymos, most of them shortened to one phase; dymos' own examples are listed beside them, with the values that its
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
        quantity="r(T)",
        note="take-off climb alone, from V_1",
    ),
    "OptimalControl.jl: beam": PublishedOptimum("8.88928", f"{PAGES}/beam.html", mechanics.beam),
    "OptimalControl.jl: bioreactor": PublishedOptimum(
        "-12.9257", f"{PAGES}/bioreactor.html", processes.bioreactor, singular=True
    ),
    "OptimalControl.jl: brachistochrone": PublishedOptimum(
        "1.80293", f"{PAGES}/brachistochrone.html", quantity="T", same_as="collection: brachistochrone, drop"
    ),
    "OptimalControl.jl: Bryson-Denham": PublishedOptimum(
        "4.00014", f"{PAGES}/bryson_denham.html", same_as="collection: Bryson-Denham"
    ),
    "OptimalControl.jl: cannonball": PublishedOptimum(
        "", f"{MODELS}/cannonball.jl", flights.cannonball, quantity="r(T)", sign=-1.0
    ),
    "OptimalControl.jl: cart pendulum": PublishedOptimum(
        "1.74397", f"{PAGES}/cart_pendulum.html", mechanics.cart_pendulum, quantity="T"
    ),
    "OptimalControl.jl: chain": PublishedOptimum("5.06858", f"{PAGES}/chain.html", same_as="collection: hanging chain"),
    "OptimalControl.jl: dielectrophoretic particle": PublishedOptimum(
        "7.81132", f"{PAGES}/dielectrophoretic_particle.html", mechanics.dielectrophoretic_particle, quantity="T"
    ),
    "OptimalControl.jl: double oscillator": PublishedOptimum(
        "0.000910923", f"{PAGES}/double_oscillator.html", mechanics.double_oscillator
    ),
    "OptimalControl.jl: ducted fan": PublishedOptimum("1831.83", f"{PAGES}/ducted_fan.html", vehicles.ducted_fan),
    "OptimalControl.jl: electric vehicle": PublishedOptimum(
        "1228.6", f"{PAGES}/electric_vehicle.html", vehicles.electric_vehicle
    ),
    "OptimalControl.jl: glider": PublishedOptimum("-1247.98", f"{PAGES}/glider.html", same_as="COPS: glider"),
    "OptimalControl.jl: insurance": PublishedOptimum("-2.05921", f"{PAGES}/insurance.html", processes.insurance),
    "OptimalControl.jl: Jackson": PublishedOptimum(
        "-0.191822", f"{PAGES}/jackson.html", processes.jackson, singular=True
    ),
    "OptimalControl.jl: moonlander": PublishedOptimum(
        "0.96181", f"{PAGES}/moonlander.html", vehicles.moonlander, quantity="T"
    ),
    "OptimalControl.jl: mountain car": PublishedOptimum(
        "102.398", f"{PAGES}/mountain_car.html", mechanics.mountain_car, quantity="T"
    ),
    "OptimalControl.jl: quadrotor": PublishedOptimum("", f"{MODELS}/quadrotor.jl", vehicles.quadrotor),
    "OptimalControl.jl: Robbins": PublishedOptimum("19.4666", f"{PAGES}/robbins.html", mechanics.robbins),
    "OptimalControl.jl: Robertson": PublishedOptimum(
        "", f"{MODELS}/robertson.jl", processes.robertson, quantity="z(T)", sign=-1.0
    ),
    "OptimalControl.jl: robot": PublishedOptimum(
        "9.14113", f"{PAGES}/robot.html", quantity="T", same_as="collection: robot arm"
    ),
    "OptimalControl.jl: rocket": PublishedOptimum(
        "-1.01284", f"{PAGES}/rocket.html", origin=-1.0, singular=True, same_as="collection: Goddard"
    ),
    "OptimalControl.jl: space shuttle": PublishedOptimum(
        "0.595875", f"{PAGES}/space_shuttle.html", vehicles.space_shuttle, quantity="θ(T)", sign=-1.0
    ),
    "OptimalControl.jl: SSTO": PublishedOptimum(
        "", f"{MODELS}/ssto_earth.jl", flights.single_stage_to_orbit, quantity="T"
    ),
    "OptimalControl.jl: steering": PublishedOptimum(
        "0.554572", f"{PAGES}/steering.html", quantity="T", same_as="collection: steering"
    ),
    "OptimalControl.jl: truck trailer": PublishedOptimum(
        "59.2303", f"{PAGES}/truck_trailer.html", vehicles.truck_trailer
    ),
    "OptimalControl.jl: van der Pol": PublishedOptimum("1.04781", f"{PAGES}/vanderpol.html", mechanics.van_der_pol),
    "OptimalControl.jl: water rocket": PublishedOptimum(
        "", f"{MODELS}/water_rocket.jl", flights.water_rocket, quantity="h(T)", sign=-1.0
    ),
    "dymos: balanced field": PublishedOptimum(
        "2197.7", f"{DYMOS}/balanced_field/balanced_field.ipynb, to 1e-2", dymos_flights.balanced_field, quantity="r(T)"
    ),
    "dymos: cannonball": PublishedOptimum(
        "3183.25",
        f"{DYMOS}/multi_phase_cannonball/multi_phase_cannonball.ipynb, to 1e-2",
        dymos_flights.cannonball,
        quantity="r(T)",
        sign=-1.0,
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
        "143", f"{DYMOS}/ssto_earth/ssto_earth.ipynb, to 5e-2", dymos_flights.single_stage_to_orbit, quantity="T"
    ),
    "dymos: water rocket, height": PublishedOptimum(
        "53.5",
        f"{DYMOS}/water_rocket/water_rocket.ipynb, to 1e-2",
        dymos_flights.water_rocket,
        quantity="h(T)",
        sign=-1.0,
    ),
    "dymos: water rocket, range": PublishedOptimum(
        "85.11",
        f"{DYMOS}/water_rocket/water_rocket.ipynb, to 1e-2",
        partial(dymos_flights.water_rocket, farthest=True),
        quantity="r(T)",
        sign=-1.0,
    ),
}
