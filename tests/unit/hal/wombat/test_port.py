"""The Wombat port on the emulator: what a program sees, and what it is never shown."""

import contextlib
import math
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from bench_robot import K_E, BenchRobot
from raccoon.core.clock import SteppedClock
from raccoon.core.errors import ConfigError, HardwareError
from raccoon.core.readings import STOP, Fault, Inputs, Outputs
from raccoon.hal.supervise.supervisor import Supervisor
from raccoon.hal.wombat.emulator import Emulator, Firmware, emulator
from raccoon.hal.wombat.port import WombatPort, open_wombat

FIRMWARES: list[Firmware] = ["stock", 17, 21]
FORWARD = Outputs(duty=(0.6, 0.6, 0.0, 0.0))


OPENED: list[WombatPort] = []


@pytest.fixture(autouse=True)
def all_closed() -> Iterator[None]:
    yield
    while OPENED:
        with contextlib.suppress(HardwareError):
            OPENED.pop().close()


class Bench:
    def __init__(
        self, firmware: Firmware, build: Any = "shipped", noise: bool = True, **options: Any
    ) -> None:
        self.clock = SteppedClock()
        self.robot = BenchRobot()
        self.emulator = Emulator(self.robot, firmware, clock=self.clock, build=build, noise=noise)
        self.port = WombatPort(self.emulator, clock=self.clock, **options)
        OPENED.append(self.port)

    def run(self, outputs: Outputs, cycles: int) -> list[Inputs]:
        seen = []
        for _ in range(cycles):
            seen.append(self.port.read())
            self.port.write(outputs)
        return seen


@pytest.fixture(params=FIRMWARES)
def bench(request: pytest.FixtureRequest) -> Bench:
    return Bench(request.param)


def metres_a_tick(inputs: Inputs) -> float:
    return inputs.device.position_counts_seconds * inputs.device.bemf_volts / K_E * 0.0345


def test_positions_agree_with_the_wheels(bench: Bench) -> None:
    bench.run(STOP, 20)
    bench.run(FORWARD, 200)
    last = bench.run(STOP, 200)[-1]
    for wheel in (0, 1):
        position = last.position[wheel]
        assert position is not None
        travelled = 0.0345 * bench.robot.angles[wheel]
        assert travelled > 0.1
        assert position * metres_a_tick(last) == pytest.approx(travelled, rel=0.003)


def test_backemf_agrees_with_the_wheels(bench: Bench) -> None:
    last = bench.run(FORWARD, 120)[-1]
    for wheel in (0, 1):
        counts = last.bemf[wheel]
        assert counts is not None
        volts = K_E * bench.robot.speeds[wheel]
        assert counts * last.device.bemf_volts == pytest.approx(volts, rel=0.01)


def test_the_counters_are_as_late_as_the_device_says(bench: Bench) -> None:
    seen = bench.run(FORWARD, 80)
    late = []
    for _ in range(40):
        inputs = bench.run(FORWARD, 1)[-1]
        per_count = inputs.device.bemf_volts / K_E
        moved = (inputs.position[0] or 0) - (seen[0].position[0] or 0)
        missing = bench.robot.angles[0] - moved * inputs.device.position_counts_seconds * per_count
        late.append(missing / bench.robot.speeds[0])
    assert inputs.device.bemf_lag is not None
    # Besides, a reading is half an update old on average.
    assert 0.0 < sum(late) / len(late) - inputs.device.bemf_lag < 0.004


@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 333.0])
def test_other_rates_see_the_same(rate_hz: float) -> None:
    bench = Bench("stock", rate_hz=rate_hz)
    seen = bench.run(FORWARD, round(rate_hz))
    last, position = seen[-1], seen[-1].position[0]
    counts = [each.bemf[0] for each in seen if each.bemf[0] is not None][-1]
    assert position is not None
    assert counts * last.device.bemf_volts == pytest.approx(K_E * bench.robot.speeds[0], rel=0.01)
    # Driving, the filter is about 15 ms behind.
    lag = 0.02 * bench.robot.speeds[0]
    assert position * metres_a_tick(last) / 0.0345 == pytest.approx(bench.robot.angles[0] - lag / 2, abs=lag)


@pytest.mark.parametrize("rate_hz", [40.0, 120.0, 240.0])
def test_no_rate_beats_with_the_updates_of_the_counters(rate_hz: float) -> None:
    """At 235 uneven updates a second and 240 looks, two updates were now and then taken for a faster one."""
    bench = Bench("stock", rate_hz=rate_hz)
    bench.run(FORWARD, round(rate_hz))
    seen = [each.bemf[0] for each in bench.run(FORWARD, round(2.5 * rate_hz)) if each.bemf[0] is not None]
    assert max(seen) < 1.05 * min(seen)


def test_the_same_sign_turns_the_same_way_on_every_firmware(bench: Bench) -> None:
    seen = bench.run(Outputs(duty=(-0.5, 0.5, 0.3, -0.3)), 150)
    speeds = bench.robot.speeds
    assert [math.copysign(1, each) for each in speeds] == [-1, 1, 1, -1]
    for port, sign in enumerate((-1, 1, 1, -1)):
        assert sign * (seen[-1].bemf[port] or 0.0) > 100.0
        assert sign * (seen[-1].position[port] or 0.0) > 0.0
    rates = [each.turn_rate for each in seen if each.turn_rate is not None]
    assert rates[-1] == pytest.approx(bench.robot.turn_rate, rel=0.05)
    assert rates[-1] > 0.5  # to the left


def test_zero_duty_coasts_or_brakes(bench: Bench) -> None:
    bench.run(FORWARD, 100)
    bench.run(Outputs(brake=(True, False, False, False)), 12)
    braked, coasting = bench.robot.speeds[:2]
    assert braked < 0.5 * coasting


def test_sensors_and_button(bench: Bench) -> None:
    bench.robot.digital = (True, *(False,) * 8, True)
    bench.robot.button = True
    last = bench.run(STOP, 120)[-1]
    assert last.digital == (True, *(False,) * 8, True)
    assert last.extra == {"button": 1.0}
    for port, level in enumerate(bench.robot.analog):
        # The stock filter settles up to 9 counts low.
        assert level - 11 <= (last.analog[port] or 0.0) <= level + 4
    # The stock battery filter settles up to 19 counts low: 0.17 V.
    assert last.battery_voltage == pytest.approx(6.8, abs=0.2)


@pytest.mark.parametrize(
    ("firmware", "build", "bemf_hz", "imu_hz"),
    [
        ("stock", "shipped", 235.0, 188.0),
        ("stock", "published", 267.5, None),
        (17, "shipped", 181.0, 50.0),
        (17, "published", 200.0, 50.0),
        (21, "shipped", None, 50.0),
    ],
)
def test_rates_are_measured(
    firmware: Firmware, build: str, bemf_hz: float | None, imu_hz: float | None
) -> None:
    bench = Bench(firmware, build)
    bench.run(FORWARD, 300)
    rates = bench.port.rates
    assert rates.cycle == pytest.approx(200.0)
    assert rates.bemf == (None if bemf_hz is None else pytest.approx(bemf_hz, rel=0.01))
    assert rates.imu == (None if imu_hz is None else pytest.approx(imu_hz, rel=0.02))


def test_an_imu_that_is_read_once_a_second_is_news_once_a_second() -> None:
    bench = Bench("stock", "published")
    seen = bench.run(FORWARD, 600)
    fresh = [each.time for each in seen if each.gyro is not None]
    assert 3 <= len(fresh) <= 4
    assert fresh[-1] - fresh[-2] == pytest.approx(0.935, abs=0.01)


def test_repeated_imu_words_are_not_news(bench: Bench) -> None:
    seen = bench.run(STOP, 200)
    fresh = sum(each.gyro is not None for each in seen)
    expected = 188 if bench.emulator.firmware == "stock" else 50
    assert fresh == pytest.approx(expected, abs=4)


def test_an_imu_that_freezes_after_a_pause_is_told_as_soon_as_before_it(bench: Bench) -> None:
    bench.run(STOP, 200)
    rate = bench.port.rates.imu
    bench.clock.advance(30.0)  # somebody is asked to press Enter
    assert Fault.IMU_FROZEN not in bench.run(STOP, 20)[-1].faults
    assert bench.port.rates.imu == pytest.approx(rate, rel=0.05)
    bench.emulator.faults.imu_frozen = True
    assert Fault.IMU_FROZEN in bench.run(STOP, 40)[-1].faults


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_a_robot_at_rest_may_repeat_itself_for_ever(firmware: Firmware) -> None:
    bench = Bench(firmware, noise=False)
    bench.emulator.faults.imu_frozen = True
    quiet = bench.run(STOP, 500)
    assert Fault.STALE not in {fault for inputs in quiet for fault in inputs.faults}
    assert None not in quiet[-1].position
    driven = bench.run(FORWARD, 100)
    assert Fault.STALE not in {fault for inputs in driven for fault in inputs.faults}
    assert (driven[-1].position[0] or 0.0) > 0.0


def pause_that_stops(bench: Bench) -> None:
    """Drive, and then a pause of the program in which its supervisor stops the motors."""
    guard = Watched()
    bench.port._guard = guard
    bench.port._hold(bench.port.dialect.hold(FORWARD))
    bench.run(FORWARD, 100)
    bench.clock.advance(0.5)
    bench.emulator.transfer(guard.held[-1])
    bench.clock.advance(1.0)


def test_wheels_that_stood_still_in_a_pause_are_no_fault(bench: Bench) -> None:
    """The supervisor has stopped them; the program goes on, and stands for now."""
    pause_that_stops(bench)
    bench.port.read()  # its own lateness is told
    bench.port.write(STOP)
    seen = bench.run(STOP, 20)
    assert not any(each.faults for each in seen[3:])
    assert all(each.position[0] is not None for each in seen[3:])


@pytest.mark.parametrize("seconds", [0.06, 0.0731, 0.1, 0.102, 0.104, 0.5])
def test_the_first_back_emf_after_a_pause_is_that_of_now(bench: Bench, seconds: float) -> None:
    """They roll out meanwhile: a mean over the pause would be a multiple of it, or not 0 where they stand."""
    bench.run(FORWARD, 100)
    bench.port.write(Outputs())
    bench.clock.advance(seconds)
    first = bench.port.read().bemf[0]
    bench.port.write(Outputs())
    after = bench.port.read().bemf[0]
    assert first is not None
    assert after is not None
    assert 0.65 * first - 25.0 <= after <= first + 25.0


def test_motors_that_were_stopped_in_a_pause_and_start_again_are_no_fault(bench: Bench) -> None:
    pause_that_stops(bench)
    bench.run(FORWARD, 100)
    assert Fault.MOTOR_FAULT not in bench.port.fault_counts
    bench.emulator.faults.blown_fuse = {0}
    bench.run(FORWARD, 60)
    assert Fault.MOTOR_FAULT in bench.port.fault_counts


@pytest.mark.parametrize("firmware", FIRMWARES)
@pytest.mark.parametrize("before", [STOP, FORWARD], ids=["from rest", "driving"])
def test_a_hanging_controller_is_stopped_all_the_same(firmware: Firmware, before: Outputs) -> None:
    bench = Bench(firmware)
    bench.run(before, 100)
    bench.port._reset_line = bench.emulator
    bench.emulator.faults.frozen = True
    with pytest.raises(HardwareError, match="stale: the controller has repeated itself"):
        bench.run(FORWARD, 105)
    bench.clock.advance(0.05)
    bench.emulator.run()
    assert not bench.emulator.motors_running


def test_a_controller_that_hangs_while_the_robot_is_told_to_stop_is_stopped(bench: Bench) -> None:
    bench.port._reset_line = bench.emulator
    bench.run(FORWARD, 100)
    bench.emulator.faults.frozen = True
    with pytest.raises(HardwareError, match="stale"):
        bench.run(STOP, 60)
    assert not bench.emulator.motors_running


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_what_was_not_counted_while_it_hung_for_a_moment_is_said(firmware: Firmware) -> None:
    bench = Bench(firmware)
    bench.run(FORWARD, 100)
    bench.emulator.faults.frozen = True
    bench.run(FORWARD, 20)
    bench.emulator.faults.frozen = False
    counting = [inputs for inputs in bench.run(FORWARD, 20) if inputs.position[0] is not None]
    assert len(counting) > 12
    told = [Fault.POSITION_JUMP in inputs.faults for inputs in counting[:3]]
    assert (told[0], told[2]) == (True, False)  # the other motor's may go on a cycle later


def test_wheels_that_came_to_rest_while_the_controller_restarted_are_read(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(emulator, "BOOT_SECONDS", 0.45)  # longer than they roll out
    bench.run(FORWARD, 100)
    bench.emulator.reset()
    seen = bench.run(STOP, 150)
    (begun,) = [each.time for each in seen if Fault.RESET in each.faults]
    # The stock firmware's filter of the analog words rises from 0 meanwhile.
    analog = [(each.time - begun, set(each.analog) == {None}) for each in seen if each.time >= begun]
    assert all(is_blank is (since < 0.099) for since, is_blank in analog if not 0.099 < since < 0.101)
    assert not seen[-1].faults
    assert None not in (*seen[-1].position, *seen[-1].bemf)


def test_offsets_at_rest_are_measured() -> None:
    bench = Bench(17)
    bench.emulator.faults.bemf_offset = (-31.5, 54.9, 0.0, 0.0)  # the wire's sign is the other one
    seen = bench.run(STOP, 300)
    assert bench.port.standstill_bemf == pytest.approx((31.5, -54.9, 0.0, 0.0), abs=2.0)
    assert Fault.BEMF_INVALID in seen[-1].faults


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_offsets_that_are_known_are_no_fault(firmware: Firmware) -> None:
    bench = Bench(firmware, resting_bemf=(31.5, -54.9, 0.0, 0.0))
    bench.emulator.faults.bemf_offset = (-31.5, 54.9, 0.0, 0.0) if firmware != "stock" else (0.0,) * 4
    seen = bench.run(STOP, 200)
    assert not any(each.faults for each in seen)
    bench.emulator.faults.bemf_offset = (-31.5, 54.9, 90.0, 0.0)
    assert Fault.BEMF_INVALID in bench.run(STOP, 200)[-1].faults


def test_two_controllers_with_one_frame_length_apart_are_told_apart_when_shifted() -> None:
    for firmware in FIRMWARES:
        clock = SteppedClock()
        emulator = Emulator(BenchRobot(), firmware, clock=clock)
        emulator.transfer(bytes(100))
        port = WombatPort(emulator, clock=clock)
        assert port.dialect.name == ("stock" if firmware == "stock" else f"RaccoonOS {firmware}")
        port.read()
        assert port.read().faults == ()
        port.close()


@pytest.mark.parametrize("silence", [0x00, 0xFF])
def test_a_silent_bus_is_named(silence: int) -> None:
    clock = SteppedClock()
    emulator = Emulator(BenchRobot(), "stock", clock=clock)
    emulator.faults.silent = silence
    with pytest.raises(HardwareError, match=rf"does not answer \(all 0x{silence:02X}\)"):
        WombatPort(emulator, clock=clock)
    assert clock.now() == pytest.approx(2.9)  # it might have been starting


def test_single_dead_frames_before_and_after_a_pause_are_no_lost_link(bench: Bench) -> None:
    bench.run(STOP, 20)
    for _ in range(2):
        bench.emulator.faults.silent = 0
        assert Fault.LINK_DEAD in bench.port.read().faults
        bench.clock.advance(3.0)
    bench.emulator.faults.silent = None
    assert bench.run(STOP, 3)[-1].faults == ()


@pytest.mark.parametrize("word", [0x00, 0xFF])
def test_single_dead_frames_are_no_restarts(bench: Bench, word: int) -> None:
    bench.run(FORWARD, 40)
    for _ in range(4):
        bench.emulator.faults.silent = word
        assert bench.port.read().faults == (Fault.LINK_DEAD,)
        bench.emulator.faults.silent = None
        bench.port.write(FORWARD)
        bench.run(FORWARD, 20)
    assert bench.port.fault_counts[Fault.LINK_DEAD] == 4
    assert Fault.RESET not in bench.port.fault_counts


def test_a_controller_that_restarts_as_soon_as_it_drives_is_given_up(bench: Bench) -> None:
    bench.run(FORWARD, 40)

    def drive_until_it_breaks_down() -> None:
        for _ in range(20):
            bench.emulator.reset()  # the battery gives way under the first command
            while Fault.LINK_DEAD in bench.run(FORWARD, 1)[0].faults:
                pass

    with pytest.raises(HardwareError, match="restarted 3 times within 10 s: charge the battery"):
        drive_until_it_breaks_down()
    assert bench.port.fault_counts[Fault.RESET] == 2  # the third is the error


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_frames_shifted_after_a_pause_are_no_restarts(firmware: Firmware) -> None:
    bench = Bench(firmware)
    for _ in range(4):
        bench.run(STOP, 3)
        bench.clock.sleep_until(bench.clock.now() + 0.3)
        bench.emulator.transfer(bytes(7))
        bench.run(STOP, 3)
    assert bench.port.fault_counts[Fault.MISALIGNED] == 4
    assert Fault.RESET not in bench.port.fault_counts


def test_frames_that_break_off_are_no_restarts() -> None:
    bench = Bench("stock")
    bench.run(FORWARD, 40)
    whole = bench.emulator.transfer
    for _ in range(4):
        # The wire goes dead in the middle of the frame, before the canary and the counters.
        bench.emulator.transfer = lambda frame: whole(frame)[:20].ljust(len(frame), b"\0")  # type: ignore[method-assign]
        bench.port.read()
        bench.emulator.transfer = whole  # type: ignore[method-assign]
        bench.run(FORWARD, 20)
    assert Fault.RESET not in bench.port.fault_counts


def test_a_version_of_another_time_is_named() -> None:
    clock = SteppedClock()
    emulator = Emulator(BenchRobot(), 17, clock=clock)
    emulator.faults.wrong_version = True
    emulator.transfer(bytes(248))  # the first byte after power-on is void
    with pytest.raises(HardwareError, match="RaccoonOS answers with protocol version 18"):
        WombatPort(emulator, clock=clock)


def test_a_failed_port_repeats_its_reason(bench: Bench) -> None:
    bench.run(FORWARD, 50)
    bench.emulator.faults.silent = 0x00
    with pytest.raises(HardwareError, match="lost"):
        bench.run(FORWARD, 200)
    for use in (bench.port.read, lambda: bench.port.write(STOP)):
        with pytest.raises(HardwareError, match="lost"):
            use()
    bench.port.close()


def test_a_closed_port_says_so_and_moves_nothing(bench: Bench) -> None:
    """Also where a transfer of another length has shifted all frames: the stop finds its way."""
    bench.run(FORWARD, 5)
    bench.emulator.transfer(bytes(7))
    bench.port.close()
    for use in (bench.port.read, lambda: bench.port.write(FORWARD)):
        with pytest.raises(HardwareError, match="the port is closed"):
            use()
    assert not bench.emulator.motors_running


def test_the_reset_line_stops_what_no_longer_listens(bench: Bench) -> None:
    port = WombatPort(bench.emulator, clock=bench.clock, reset_line=bench.emulator)
    for _ in range(50):
        port.read()
        port.write(FORWARD)
    bench.emulator.faults.frozen = True
    bench.port = port
    with pytest.raises(HardwareError, match="main loop") as hangs:
        bench.run(FORWARD, 200)
    assert not bench.emulator.motors_running
    assert "may still run" not in str(hangs.value)
    port.close()


def test_without_a_reset_line_the_danger_is_told(bench: Bench) -> None:
    bench.run(FORWARD, 50)
    bench.emulator.faults.frozen = True
    with pytest.raises(HardwareError, match="motors may still run: switch the Wombat off"):
        bench.run(FORWARD, 200)
    bench.port.close()


def test_a_stop_that_is_lost_is_sent_until_the_controller_shows_it(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench("stock")
    bench.run(FORWARD, 50)
    link, lost = bench.port._link, iter([True] * 4)
    transfer = link.transfer
    monkeypatch.setattr(
        link, "transfer", lambda frame: transfer(bytes(len(frame)) if next(lost, False) else frame)
    )
    bench.port.close()
    assert not bench.emulator.motors_running


def test_closing_without_an_answer_is_an_error() -> None:
    bench = Bench("stock")
    bench.run(FORWARD, 20)
    bench.emulator.faults.silent = 0xFF
    with pytest.raises(HardwareError, match="did not confirm"):
        bench.port.close()
    bench.port.close()


class Watched:
    def __init__(self) -> None:
        self.beats = 0
        self.held: list[bytes] = []
        self.ended: bool | None = None

    def beat(self) -> None:
        self.beats += 1

    def hold(self, frame: bytes) -> None:
        self.held.append(frame)

    def close(self, *, stopped: bool = True) -> None:
        self.ended = stopped


class Gone(Watched):
    def __init__(self) -> None:
        super().__init__()
        self.gone = False

    def beat(self) -> None:
        if self.gone:
            raise HardwareError("the supervisor process is gone")


class TakenLine:
    """A reset line whose pin another program has."""

    def pulse(self) -> None:
        raise HardwareError("the reset line failed: busy")


def test_ctrl_c_while_it_closes_comes_after_the_stop(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    guard, link = Watched(), bench.port._link
    bench.port._guard = guard
    bench.run(FORWARD, 50)
    presses, transfer = iter([True]), link.transfer

    def pressed(frame: bytes) -> bytes:
        if next(presses, False):
            raise KeyboardInterrupt
        return transfer(frame)

    monkeypatch.setattr(link, "transfer", pressed)
    with pytest.raises(KeyboardInterrupt):
        bench.port.close()
    assert not bench.emulator.motors_running
    assert guard.ended is True
    bench.port.close()


@pytest.mark.parametrize("use", [WombatPort.read, lambda port: port.write(FORWARD)], ids=["read", "write"])
def test_nobody_drives_without_a_guard(use: Callable[[WombatPort], object]) -> None:
    guard = Gone()
    bench = Bench("stock", guard=guard)
    bench.run(FORWARD, 30)
    guard.gone = True
    with pytest.raises(HardwareError, match="supervisor process is gone"):
        use(bench.port)
    bench.clock.advance(0.02)
    bench.emulator.run()
    assert not bench.emulator.motors_running


def test_the_guard_hears_every_cycle_and_the_end() -> None:
    guard = Watched()
    bench = Bench("stock", guard=guard)
    bench.run(FORWARD, 10)
    assert guard.beats >= 20
    bench.port.close()
    assert guard.ended is True


def test_a_forked_process_that_ends_stops_nothing_of_its_parent() -> None:
    guard = Watched()
    bench = Bench("stock", guard=guard)
    bench.run(FORWARD, 20)
    child = os.fork()
    if child == 0:  # pragma: no cover - in the child, with a controller of its own
        with contextlib.suppress(BaseException):
            bench.port.close()
            os._exit(0 if bench.emulator.motors_running and guard.ended is None else 1)
        os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


@pytest.mark.parametrize("fault", [{"silent": 0xFF}, {"frozen": True}], ids=["silent", "hangs"])
def test_the_guard_stops_motors_that_a_port_which_has_failed_could_not(
    bench: Bench, fault: dict[str, Any]
) -> None:
    guard = Watched()
    bench.port._guard, bench.port._reset_line = guard, TakenLine()
    bench.run(FORWARD, 50)
    for name, value in fault.items():
        setattr(bench.emulator.faults, name, value)
    with pytest.raises(HardwareError, match="motors may still run"):
        bench.run(FORWARD, 200)
    bench.port.close()
    assert guard.ended is False


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_what_the_guard_holds_stops_motors_and_leaves_servos(firmware: Firmware) -> None:
    guard = Watched()
    bench = Bench(firmware, guard=guard)
    for pulse in (900, 1700):
        bench.run(Outputs(FORWARD.duty, servo_us=(pulse, None, None, None)), 40)
        bench.emulator.transfer(guard.held[-1])
        bench.clock.advance(0.02)
        bench.emulator.run()
        assert not bench.emulator.motors_running
        assert bench.emulator.servo_us == (pulse, None, None, None)
    assert len(guard.held) == 3  # at rest, and once for each place, however many cycles there were


@pytest.mark.parametrize("firmware", [17, 21])
def test_what_the_guard_holds_lets_the_counters_run_on(firmware: Firmware) -> None:
    """RaccoonOS stops them while its motors are shut down."""
    guard = Watched()
    bench = Bench(firmware, guard=guard)
    bench.run(FORWARD, 100)
    bench.emulator.transfer(guard.held[-1])
    bench.clock.advance(1.0)  # it rolls out meanwhile
    last = bench.run(STOP, 40)[-1]
    position = last.position[0]
    assert position is not None
    travelled = 0.0345 * bench.robot.angles[0]
    assert position * metres_a_tick(last) == pytest.approx(travelled, rel=0.01)


def test_servos_that_an_error_has_switched_off_stay_off(bench: Bench) -> None:
    guard, closed = Watched(), Outputs(FORWARD.duty, servo_us=(1700, None, None, None))
    bench.port._guard = guard
    bench.run(closed, 40)
    bench.emulator.faults.silent = 0x00
    with pytest.raises(HardwareError, match="lost"):
        bench.run(closed, 200)
    bench.emulator.faults.silent = None
    bench.emulator.transfer(guard.held[-1])
    bench.clock.advance(0.02)
    bench.emulator.run()
    assert bench.emulator.servo_us == (None,) * 4
    assert not bench.emulator.motors_running


@pytest.mark.parametrize("rate", [10.0, 501.0, math.nan])
def test_impossible_rates_are_refused(rate: float) -> None:
    clock = SteppedClock()
    with pytest.raises(ConfigError, match="rate_hz"):
        WombatPort(Emulator(BenchRobot(), "stock", clock=clock), clock=clock, rate_hz=rate)


class OnTheBus:
    """The real bus's part towards whoever opens it, with an emulated controller behind it."""

    def __init__(self, firmware: Firmware, file: Any) -> None:
        self._emulator = Emulator(BenchRobot(), firmware)
        self.transfer = self._emulator.transfer
        self.target = "unix:/nowhere"
        self.lock = SimpleNamespace(descriptor=file.fileno())
        self.closed = False

    def close(self) -> None:
        self.closed = True


@pytest.mark.parametrize(
    ("kind", "firmware", "message"),
    [
        ("wombat", 17, "but RaccoonOS 17 answers: write 'wombat-raccoon' and calibrate again"),
        ("wombat-raccoon", "stock", "but stock answers: write 'wombat' and calibrate again"),
    ],
)
def test_another_firmware_than_robot_toml_says_is_refused(
    kind: str, firmware: Firmware, message: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with (tmp_path / "lock").open("w") as file:
        bus = OnTheBus(firmware, file)
        monkeypatch.setattr("raccoon.hal.wombat.port.SpiLink", lambda _: bus)
        with pytest.raises(HardwareError, match=message):
            open_wombat(kind)
    assert bus.closed


def test_the_real_port_has_a_supervisor_and_takes_a_measured_rate(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with (tmp_path / "lock").open("w") as file:
        bus = OnTheBus("stock", file)
        monkeypatch.setattr("raccoon.hal.wombat.port.SpiLink", lambda _: bus)
        port = open_wombat("wombat", bemf_rate_hz=268.0)
        assert isinstance(port._guard, Supervisor)
        assert port.dialect.device.position_counts_seconds == pytest.approx(250 / 268)
        port.close()
    assert bus.closed


def test_a_rate_is_refused_before_the_bus_is_touched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("raccoon.hal.wombat.port.SpiLink", lambda _: pytest.fail("the bus was opened"))
    with pytest.raises(ConfigError, match=r"rate_hz is 501\.0: allowed are numbers from 20 to 500"):
        open_wombat("wombat", rate_hz=501.0)


def test_a_port_that_cannot_be_made_leaves_nothing_open(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    class Deaf(Watched):
        def hold(self, frame: bytes) -> None:
            super().hold(frame)
            raise HardwareError("the bus has gone")

    guard = Deaf()
    monkeypatch.setattr("raccoon.hal.supervise.supervisor.Supervisor", lambda *_given, **_more: guard)
    with (tmp_path / "lock").open("w") as file:
        bus = OnTheBus("stock", file)
        monkeypatch.setattr("raccoon.hal.wombat.port.SpiLink", lambda _: bus)
        with pytest.raises(HardwareError, match="the bus has gone"):
            open_wombat("wombat")
    assert guard.ended is False
    assert bus.closed


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(ConfigError, match="allowed are wombat, wombat-raccoon"):
        open_wombat("arduino")
