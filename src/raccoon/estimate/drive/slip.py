"""Detection of the slipping wheel from wheels and gyro.

The filter's gyro innovation, after the update with both wheels, is the turn that the wheels do not explain.
If it exceeds its variance for a few steps, a wheel does not roll. Driven wheels spin rather than skid; so of
the two explanations, the wheel that reads more than it rolled is named, unless the other one reads nothing at
all.
"""

from __future__ import annotations

SLIP_GATE = 16.0
"""Gate on the squared innovation over its variance: 4 sigma."""
DOUBTFUL_SLIP_GATE, DOUBTFUL_GYRO_STD = 4.0, 0.02
"""The same gate at 2 sigma, used if the time of the turn is uncertain too; and the gyro's standard deviation,
rad/s, above which that is so."""
MIN_TURN = 0.08
"""rad/s; a smaller disagreement is not slip."""
NAMED_AFTER_S = 0.05
"""s of disagreement after which a wheel is named."""
WRONG_SCALES_AFTER_S = 3.0
"""s after which a disagreement that wrong scales can explain counts as wrong scales instead of slip."""
MAX_SCALE_ERROR, MAX_TURN_ERROR = 0.4, 0.4
"""Largest plausible relative errors of robot.toml: of the metres of a wheel's turn, and of the turn rate of
both wheels. A magnet of half strength or a track measured at the wrong edge stay below; spinning tyres do
not."""
AGREED_BEFORE_SLIP_S = 0.3
"""s of driving in which wheels and gyro agreed, after which any disagreement is slip, however long it lasts:
wrong scales disagree from the first moment of a motion."""
AFTER_SLIP_S = 0.3
"""s after a disagreement in which a wheel may still slip by less than the gate: that looks like a wrong
scale."""
RESTING_SPEED = 0.3
"""rad/s below which a wheel counts as reading nothing."""


class SlipWatch:
    """Memory of the disagreement between wheels and gyro.

    wheel: "left" or "right" while one is named, else None. slipped: a wheel was named in a motion that had
    begun without slip; until the robot stands it may slide along something, and its wheels are no evidence on
    scales.
    """

    __slots__ = (
        "_agreed_seconds",
        "_calm_seconds",
        "_scale_error_seconds",
        "_seconds_since_slip",
        "_slip_seconds",
        "_suspect",
        "slipped",
        "wheel",
    )

    def __init__(self) -> None:
        self._slip_seconds = 0.0
        self._scale_error_seconds = 0.0
        self._calm_seconds = 0.0
        self._seconds_since_slip = AFTER_SLIP_S
        self._agreed_seconds = 0.0
        self._suspect: str | None = None
        self.slipped = False
        self.wheel: str | None = None

    @property
    def scales_are_wrong(self) -> bool:
        """Whether the disagreement has fitted wrong scales for longer than a wheel slips."""
        return self._scale_error_seconds > WRONG_SCALES_AFTER_S

    def disagrees(self, innovation: float, variance: float) -> bool:
        """Whether the turn that the wheels do not explain (rad/s) is more than noise."""
        return abs(innovation) > MIN_TURN and innovation * innovation > SLIP_GATE * variance

    def may_slip(self, innovation: float, variance: float, gyro_variance: float) -> bool:
        """Whether a wheel may slip: one did a moment ago, or the gyro's rate changes so fast that the time of
        the change is uncertain, as when the robot is turned by what it runs into.

        gyro_variance: (rad/s)^2, variance of the turn rate including that uncertainty.
        """
        if self._seconds_since_slip < AFTER_SLIP_S:
            return True
        disagrees = innovation * innovation > max(MIN_TURN**2, DOUBTFUL_SLIP_GATE * variance)
        return disagrees and gyro_variance > DOUBTFUL_GYRO_STD**2

    def begin_rest(self) -> None:
        """The robot stands: the next motion is a new one."""
        self._agreed_seconds = 0.0
        self.slipped = False

    def take_agreement(self, span: float, driven: bool) -> None:
        """Wheels and gyro agreed over `span` s. driven: the wheels turned."""
        self._seconds_since_slip += span
        if driven and not self.slipped:
            self._agreed_seconds += span
        if self._slip_seconds == 0.0:
            return
        self._calm_seconds += span
        if self._calm_seconds > 2.0 * NAMED_AFTER_S:
            self.reset()

    def take_disagreement(
        self, span: float, innovation: float, left: float, right: float, may_be_scales: bool
    ) -> str:
        """The wheel to distrust over `span` s. innovation: rad/s of turn that the wheels do not explain;
        left, right: rad/s of the wheels. may_be_scales: whether wrong scales can explain it as well."""
        suspect = slipping_wheel(innovation, left, right)
        if suspect != self._suspect:
            self._slip_seconds = self._scale_error_seconds = 0.0
            self._suspect = suspect
        self._slip_seconds += span
        self._scale_error_seconds = (
            self._scale_error_seconds + span
            if may_be_scales and self._agreed_seconds < AGREED_BEFORE_SLIP_S
            else 0.0
        )
        self._calm_seconds = self._seconds_since_slip = 0.0
        if self._slip_seconds > NAMED_AFTER_S:
            self.wheel = suspect
            self.slipped = self._agreed_seconds >= AGREED_BEFORE_SLIP_S
        return suspect

    def reset(self) -> None:
        """Forget the disagreement."""
        self._slip_seconds = self._scale_error_seconds = 0.0
        self.wheel = self._suspect = None


def can_scales_explain(turn: float, left: float, right: float) -> bool:
    """Whether wrong wheel scales can explain the difference between the wheels' turn and the gyro's.

    turn: by the gyro, as the wheel speed difference of that turn. left, right: wheel readings at nominal
    scale, without offsets; all in rad/s. In the filter's model the difference is balance (left + right) +
    (wheel_turn - 1) turn; only one of the two errors is assumed large.
    """
    return abs(right - left - turn) < max(MAX_SCALE_ERROR * abs(left + right), MAX_TURN_ERROR * abs(turn))


def are_scales_plausible(way: float, balance: float, wheel_turn: float) -> bool:
    """Whether these states of the filter are plausible errors of robot.toml's wheels and track width."""
    off = max(abs(way - 1.0), abs(balance))
    return off <= MAX_SCALE_ERROR and abs(wheel_turn - 1.0) <= MAX_TURN_ERROR


def slipping_wheel(innovation: float, left: float, right: float) -> str:
    """The wheel that does not roll as it reads: "left" or "right".

    A left wheel that reads too much makes the wheels' turn too small, a right one too large; backwards the
    opposite. If either could be the cause, the faster one is named. A wheel that reads nothing beside one
    that turns reads too little.
    """
    if abs(left) < RESTING_SPEED <= abs(right):
        reads_too_much = right * innovation < 0.0
        return "right" if reads_too_much else "left"
    if abs(right) < RESTING_SPEED <= abs(left):
        reads_too_much = left * innovation > 0.0
        return "left" if reads_too_much else "right"
    left_could = left * innovation > 0.0
    right_could = right * innovation < 0.0
    if left_could != right_could:
        return "left" if left_could else "right"
    return "left" if abs(left) > abs(right) else "right"


def is_slip_ambiguous(innovation: float, left: float, right: float) -> bool:
    """Whether either wheel may be the slipping one: they turn in opposite directions and both read too
    much."""
    return min(left * innovation, -right * innovation) > RESTING_SPEED * abs(innovation)
