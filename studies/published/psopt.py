"""Examples of PSOPT, an optimal control solver in C++ (Becerra), and the costs that its regression tests print.

The values are ``optimal_cost`` of ``tools/regression_baselines_all.json`` of the repository PSOPT/psopt, all 46 of
them, in the digits of that file: PSOPT's own solutions, on some 20 to 200 nodes. Its manual of application examples
prints ten of them too.
Statements and independent values are in the modules that are merged here, by the example's name.
"""

from __future__ import annotations

from mathnavi.studies.published import (
    psopt_fits,
    psopt_flight,
    psopt_guidance,
    psopt_mechanics,
    psopt_processes,
    psopt_robots,
    psopt_spacecraft,
    psopt_switching,
)
from mathnavi.studies.published.details import Details
from mathnavi.studies.published.optimum import PublishedOptimum, Statement

VALUES = {
    "alpine": "2026.363",
    "bioreactor": "-6.163913",
    "brac1": "0.8247591",
    "breakwell": "4.444439",
    "bryson_denham": "3.999539",
    "bryson_max_range": "-1.712313",
    "catmix": "-0.0480532",
    "chain": "5.06848",
    "coulomb": "2.104992",
    "cracking": "0.004319519",
    "crane": "0.005151238",
    "dae_i3": "2.445648e-18",
    "delay1": "3.770849",
    "dqc": "6.0",
    "geodesic": "5664.873",
    "glider": "-1250.19",
    "goddard": "-1.025336",
    "heat": "4.372843e-05",
    "hypersensitive": "1.330826",
    "interior_point": "0.9205314",
    "isoperimetric": "-0.3755058",
    "lambert": "0.0",
    "launch": "-7529.661",
    "low_thrust": "-0.2203403",
    "lts": "0.5545709",
    "manutec": "20.4042",
    "missile": "40.91862",
    "moon": "1.420411",
    "mpec": "1.678929",
    "notorious": "0.8806615",
    "obstacle": "4.571044",
    "param2": "404.9887",
    "predator": "0.02753366",
    "rayleigh": "44.77625",
    "reorientation": "28.63041",
    "shuttle_reentry": "-34.14119",
    "singular5": "0.119262",
    "stc1": "0.169818",
    "steps": "1.000027",
    "twoburn": "-0.2367249",
    "twolinkarm": "2.988662",
    "twophase_robot": "1.042568",
    "twophase_schwartz": "3.138721e-16",
    "user": "-1.712313",
    "wheat": "-1.742652",
    "zpm": "6680106.0",
}
"""cost of an example, as ``tools/regression_baselines_all.json`` has it"""

MANUAL = {
    "brac1": "8.247591e-01",
    "bryson_max_range": "-1.712313e+00",
    "cracking": "5.228971e-03",
    "dae_i3": "2.421550e-18",
    "delay1": "2.525738e+00",
    "interior_point": "9.205314e-01",
    "launch": "-7.529661e+03",
    "manutec": "2.040610e+01",
    "singular5": "1.192613e-01",
    "twophase_schwartz": "3.138721e-16",
}
"""cost of an example, as the manual of application examples (13 August 2026) prints it"""

STATEMENTS: dict[str, Statement] = {
    **psopt_fits.STATEMENTS,
    **psopt_flight.STATEMENTS,
    **psopt_guidance.STATEMENTS,
    **psopt_mechanics.STATEMENTS,
    **psopt_processes.STATEMENTS,
    **psopt_robots.STATEMENTS,
    **psopt_spacecraft.STATEMENTS,
    **psopt_switching.STATEMENTS,
}
INDEPENDENT: dict[str, tuple[float, str]] = {
    **psopt_fits.INDEPENDENT,
    **psopt_flight.INDEPENDENT,
    **psopt_guidance.INDEPENDENT,
    **psopt_mechanics.INDEPENDENT,
    **psopt_processes.INDEPENDENT,
    **psopt_robots.INDEPENDENT,
    **psopt_spacecraft.INDEPENDENT,
    **psopt_switching.INDEPENDENT,
}
DETAILS: dict[str, Details] = {
    **psopt_fits.DETAILS,
    **psopt_flight.DETAILS,
    **psopt_guidance.DETAILS,
    **psopt_mechanics.DETAILS,
    **psopt_processes.DETAILS,
    **psopt_robots.DETAILS,
    **psopt_spacecraft.DETAILS,
    **psopt_switching.DETAILS,
}


def _published(name: str) -> PublishedOptimum:
    source = f"PSOPT, examples/{name}/{name}.cxx; value of tools/regression_baselines_all.json"
    if name in MANUAL:
        source += f"; the manual of application examples prints {MANUAL[name]}"
    independent, evidence = INDEPENDENT.get(name, (None, ""))
    return PublishedOptimum(
        VALUES[name], source, STATEMENTS.get(name), independent, evidence, **DETAILS.get(name, Details())
    )


PUBLISHED: dict[str, PublishedOptimum] = {f"PSOPT: {name}": _published(name) for name in VALUES}
"""examples of PSOPT by name"""
