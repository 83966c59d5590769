"""The scenario of `condyle simulate` without one, and a commented one to start from."""

from __future__ import annotations

from .scenario import Scenario

STARTER = """\
# A scenario: what happens to a mechanism. Run it: condyle simulate MECHANISM --scenario THIS_FILE
# SI throughout; with length_unit = "mm" lengths (thickness, rest, X..) are millimetres.

duration = 2.0                  # s
rate = 1000                     # Hz, of the results
rtol = 1e-9                     # of the integrator; method = "DOP853", "Radau", or "rk4" with step

# [start]                       # default: home, at rest
# X = 0.0                       # independent coordinates, and rates: dX

# [efforts]                     # open loop, in the place of a controller
# file = "efforts.csv"          # t, tau_<chain>, linear between rows

[controller]
kind = "computed_torque"        # joint_pd, computed_torque, impedance, bite_force, none
# motion = "path.csv"           # default: the bundled chewing path, or a trial motion
rate = 1000                     # Hz; efforts are held between samples
delay = 1                       # periods from a sample to its efforts
stiffness = 2500.0              # 1/s^2; damping [1/s] is critical by default
# model = "light.toml"          # the controller's own model, if it is not the plant's

[sensors]                       # without: the controller measures the exact state
encoder_resolution = 1e-5       # rad or m

# [drives]                      # without: rigid, and as asked for
# gear_stiffness = 200.0        # N m/rad or N/m at the joint
# backlash = 1e-3               # rad or m
# motor_constant_error = 0.05   # of the true constant, as a part of the assumed one

# [safety]                      # of the exported controller
# stop = "brake"                # or hold_then_release, hold

# [[load]]                      # any number: constant, csv, spring, food
# kind = "food"
# food = "bolus"                # bolus, firm_bolus, peanut, carrot, chow
# point = "right_molar"
"""


def default_scenario() -> Scenario:
    """Five seconds of computed torque along the path that fits the mechanism."""
    controller = {"kind": "computed_torque", "stiffness": 2500.0, "delay": 1}
    return Scenario.read({"duration": 5.0, "controller": controller})
