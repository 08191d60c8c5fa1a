"""Which wheel slips: wheels against gyro.

The filter's gyro innovation, taken after both wheels, is the turn that the wheels do not explain. More of
it than its variance allows, for a few steps, is a wheel that does not roll. Driven wheels spin rather than
skid, so of the two explanations the wheel that reads more than it rolled is named, unless the other one
reads nothing at all.
"""

from __future__ import annotations

SLIP_GATE = 16.0
"""Squared innovation over its variance: 4 sigma."""
DOUBTFUL_SLIP_GATE, DOUBTFUL_GYRO_STD = 4.0, 0.02
"""The same at 2 sigma, where the turn cannot be dated either: rad/s of its deviation."""
MIN_TURN = 0.08
"""rad/s; a smaller disagreement is no slip worth a name."""
NAMED_AFTER_S = 0.05
"""s of disagreement before a wheel is named."""
WRONG_SCALES_AFTER_S = 3.0
"""s of a disagreement that wrong scales may be, after which it is not slip: the scales are wrong."""
MAX_SCALE_ERROR, MAX_TURN_ERROR = 0.4, 0.4
"""How far robot.toml may be off about a wheel's metres, and about the turn that both wheels make, as a share.
A magnet with half its strength, a track taken at the wrong edge are not more; tyres that spin are."""
AGREED_BEFORE_SLIP_S = 0.3
"""s of driving in which wheels and gyro agreed, after which a disagreement is slip however long it lasts:
wrong scales are so from the first moment of a motion."""
AFTER_SLIP_S = 0.3
"""s after a disagreement in which a wheel may still slip by less than it takes to disagree: that looks like a
wrong scale."""
RESTING_SPEED = 0.3
"""rad/s below which a wheel reads nothing."""


class SlipWatch:
    """Memory of disagreement between wheels and gyro.

    wheel: "left" or "right" while one is named, else None. slipped: one was named in a motion that had begun
    well; the robot may slide along something until it stands, and its wheels tell no scale.
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
        """They have disagreed as wrong scales do, for longer than a wheel slips."""
        return self._scale_error_seconds > WRONG_SCALES_AFTER_S

    def disagrees(self, innovation: float, variance: float) -> bool:
        """Is the turn that the wheels do not explain (rad/s) more than noise?"""
        return abs(innovation) > MIN_TURN and innovation * innovation > SLIP_GATE * variance

    def may_slip(self, innovation: float, variance: float, gyro_variance: float) -> bool:
        """May a wheel slip: one did a moment ago, or the gyro's rate changes too fast to be dated, as where a
        robot is turned by what it runs into?

        of_gyro: (rad/s)^2 of the turn rate for that.
        """
        if self._seconds_since_slip < AFTER_SLIP_S:
            return True
        disagrees = innovation * innovation > max(MIN_TURN**2, DOUBTFUL_SLIP_GATE * variance)
        return disagrees and gyro_variance > DOUBTFUL_GYRO_STD**2

    def begin_rest(self) -> None:
        """The robot stands: what comes is another motion."""
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
        """The wheel to distrust over `span` s. innovation: rad/s more than the wheels say; speeds rad/s.
        scales: whether it may be the scales as well.
        """
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
    """Whether wrong scales of the wheels may be why they do not turn the robot as the gyro says.

    turn: by the gyro, as the difference of the wheels that would make it. left, right: what they read at the
    nominal scale, without offsets; all in rad/s. By the model of the filter the rest is
    balance (left + right) + (wheel_turn - 1) turn; only one of both is far off.
    """
    return abs(right - left - turn) < max(MAX_SCALE_ERROR * abs(left + right), MAX_TURN_ERROR * abs(turn))


def are_scales_plausible(way: float, balance: float, wheel_turn: float) -> bool:
    """Whether robot.toml may be that wrong about wheels and track width (states of the filter)."""
    off = max(abs(way - 1.0), abs(balance))
    return off <= MAX_SCALE_ERROR and abs(wheel_turn - 1.0) <= MAX_TURN_ERROR


def slipping_wheel(innovation: float, left: float, right: float) -> str:
    """The wheel that does not roll as it reads.

    A left wheel that reads too much makes the wheels' turn too small, a right one too large; backwards the
    other way round. Where both could be, the faster one is named; a wheel that reads nothing beside one
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
    """Whether nothing tells which wheel slips: both turn, each its own way, and read too much of that."""
    return min(left * innovation, -right * innovation) > RESTING_SPEED * abs(innovation)
