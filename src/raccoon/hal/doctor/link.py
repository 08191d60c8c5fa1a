"""The controller itself: which firmware answers, how regular its cycles are, and which faults its port
reported."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Fault, Inputs
from raccoon.hal.create.port import CREATE_2
from raccoon.hal.create.protocol import STREAM_PERIOD
from raccoon.hal.doctor.report import Finding, Verdict
from raccoon.hal.doctor.session import mean
from raccoon.hal.wombat.checks.monitor import Rates
from raccoon.hal.wombat.firmware.stock.wire import FIRMWARE_VERSION

RATE_TOLERANCE = 0.05
"""Largest relative error of the cycle rate."""
COUNTER_TOLERANCE = 0.03
"""Largest relative error of the counters' update rate."""
LATE_PERIODS = 2.0
"""Periods of the wanted rate; a cycle that takes longer counts as late."""
LATE_SHARE = 0.01
"""Largest share of cycles that may be late, or have a fault that the port repairs."""
_RACCOON = "wombat-raccoon-"

REMEDIES = {
    Fault.LINK_DEAD: "check the power switch, and that nothing else uses the bus; restart the controller",
    Fault.STALE: "the controller's main program hangs: restart it (or power-cycle the robot)",
    Fault.RESET: "charge the battery; look for a loose battery plug",
    Fault.BROWN_OUT: "charge the battery; look for a loose battery plug",
    Fault.POSITION_JUMP: "run the doctor again; if it stays, flash the firmware again",
    Fault.TORN: "run the doctor again; if it stays, stop other programs that use the bus",
    Fault.MISALIGNED: "stop other programs that use the bus, then restart the controller",
    Fault.IMU_FROZEN: "restart the controller; if it stays, its IMU is broken",
    Fault.IMU_IMPLAUSIBLE: "put the robot on its wheels, restart the controller; else its IMU is broken",
    Fault.COMMAND_LOST: "stop other programs that command the motors; flash the matching firmware",
    Fault.OVERRUN: "stop other programs; see docs/hardware.md on real-time priority",
    Fault.MOTOR_FAULT: "check the motor's plug and that it turns freely; let a tripped fuse cool",
    Fault.BEMF_INVALID: "see the findings on the motors at rest; if they are well, restart the controller",
    Fault.BEMF_FROZEN: "restart the controller; if it stays, its converter is broken: use another motor port",
    Fault.SENSOR_LOST: "check the plug and the supply of the added sensor",
}
# These occur now and then on a healthy robot and the port repairs them: they matter only if frequent.
_REPAIRED = {Fault.TORN, Fault.OVERRUN, Fault.COMMAND_LOST}


def identity_finding(cycles: Sequence[Inputs]) -> Finding:
    """The finding on the controller, its firmware and version, which the port verified when it was opened."""
    name = cycles[-1].device.name
    values: dict[str, float] = {}
    described = name
    if name.startswith("wombat-stock"):
        values = {"version": float(FIRMWARE_VERSION)}
        described = f"{name}: KIPR's firmware, version {FIRMWARE_VERSION}"
    elif name.startswith(_RACCOON):
        version = name.removeprefix(_RACCOON).split("+")[0]
        values = {"version": float(version)}
        described = f"{name}: RaccoonOS, protocol version {version}"
    return Finding("controller", Verdict.OK, described, values=values)


def rate_findings(config: RobotConfig, cycles: Sequence[Inputs], port: object) -> Finding:
    """The finding on the cycle rate, on late cycles, and on the update rate of the counters if the port
    measures it."""
    periods = sorted(later.time - earlier.time for earlier, later in pairwise(cycles))
    if not periods:
        return Finding("rate", Verdict.FAULT, "no cycles", "the port delivered only one cycle")
    rate = 1.0 / max(mean(periods), 1e-9)
    wanted = 1.0 / STREAM_PERIOD if cycles[-1].device is CREATE_2 else config.controller.rate_hz
    late = sum(period > LATE_PERIODS / wanted for period in periods)
    p99, longest = periods[int(0.99 * (len(periods) - 1))], periods[-1]
    measured = f"{rate:.1f} Hz; 99 % within {1e3 * p99:.2f} ms, longest {1e3 * longest:.2f} ms, {late} late"
    values = {"rate_hz": rate, "p99": p99, "longest": longest, "late": float(late)}
    counters = getattr(port, "rates", None)
    if counters is not None and counters.bemf is not None:
        measured += f"; counters {counters.bemf:.0f} Hz"
        values["counters_hz"] = counters.bemf
    remedy = REMEDIES[Fault.OVERRUN]
    if abs(rate / wanted - 1.0) > RATE_TOLERANCE:
        problem = f"{wanted:.1f} Hz are wanted"
        return Finding("rate", Verdict.FAULT, measured, problem, remedy, values)
    if late > LATE_SHARE * len(periods):
        return Finding("rate", Verdict.WARNING, measured, "too many cycles came late", remedy, values)
    if counters is not None and (problem := _describe_wrong_counters(counters)):
        remedy = (
            f"write counter_rate_hz = {counters.bemf:.1f} under [controller] in robot.toml, then calibrate"
        )
        return Finding("rate", Verdict.WARNING, measured, problem, remedy, values)
    return Finding("rate", Verdict.OK, measured, values=values)


def _describe_wrong_counters(rates: Rates) -> str:
    """Why ticks and back-EMF are computed with a wrong counter rate; empty if the rate is right or
    unknown."""
    expected, found = rates.expected_bemf, rates.bemf
    if expected is None or found is None or abs(found / expected - 1.0) <= COUNTER_TOLERANCE:
        return ""
    return f"ticks are calculated for counters at {expected:.0f} Hz: the firmware is another build"


def fault_findings(cycles: Sequence[Inputs]) -> list[Finding]:
    """One finding for each kind of fault that the port reported. ANALOG_SATURATED is left out: the findings
    of the analog ports say more."""
    counts = Counter(fault for each in cycles for fault in each.faults if fault is not Fault.ANALOG_SATURATED)
    if not counts:
        return [Finding("link", Verdict.OK, f"no faults in {len(cycles)} cycles")]
    findings = []
    for fault, count in counts.most_common():
        rare = fault in _REPAIRED and count <= LATE_SHARE * len(cycles)
        findings.append(
            Finding(
                "link",
                Verdict.OK if rare else Verdict.FAULT,
                f"{fault.value} in {count} of {len(cycles)} cycles",
                "" if rare else f"the controller's port reports {fault.value}",
                "" if rare else REMEDIES.get(fault, ""),
                {fault.value: float(count)},
            )
        )
    return findings
