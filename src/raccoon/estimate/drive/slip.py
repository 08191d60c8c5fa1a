"""Which wheel slips: wheels against gyro.

The filter's gyro innovation, taken after both wheels, is the turn that the wheels do not explain. More of
it than its variance allows, for a few steps, is a wheel that does not roll. Driven wheels spin rather than
skid, so of the two explanations the wheel that reads more than it rolled is named, unless the other one
reads nothing at all.
"""

from __future__ import annotations

GATE = 16.0
"""Squared innovation over its variance: 4 sigma."""
SOFT_GATE, DOUBTFUL_GYRO = 4.0, 0.02
"""The same at 2 sigma, where the turn cannot be dated either: rad/s of its deviation."""
LEAST_TURN = 0.08
"""rad/s; a smaller disagreement is no slip worth a name."""
NAMED_AFTER = 0.05
"""s of disagreement before a wheel is named."""
SCALES_AFTER = 3.0
"""s of a disagreement that wrong scales may be, after which it is not slip: the scales are wrong."""
MOST_SCALE, MOST_TURN = 0.4, 0.4
"""How far robot.toml may be off about a wheel's metres, and about the turn that both wheels make, as a share.
A magnet with half its strength, a track taken at the wrong edge are not more; tyres that spin are."""
BEGUN_WELL = 0.3
"""s of driving in which wheels and gyro agreed, after which a disagreement is slip however long it lasts:
wrong scales are so from the first moment of a motion."""
AFTERMATH = 0.3
"""s after a disagreement in which a wheel may still slip by less than it takes to disagree: that looks like a
wrong scale."""
RESTING_SPEED = 0.3
"""rad/s below which a wheel reads nothing."""


class SlipWatch:
    """Memory of disagreement between wheels and gyro.

    wheel: "left" or "right" while one is named, else None. slipped: one was named in a motion that had begun
    well; the robot may slide along something until it stands, and its wheels tell no scale.
    """

    __slots__ = ("_agreed", "_calm", "_of_scales", "_seconds", "_since", "_suspect", "slipped", "wheel")

    def __init__(self) -> None:
        self._seconds = 0.0
        self._of_scales = 0.0
        self._calm = 0.0
        self._since = AFTERMATH
        self._agreed = 0.0
        self._suspect: str | None = None
        self.slipped = False
        self.wheel: str | None = None

    @property
    def scales_are_wrong(self) -> bool:
        """They have disagreed as wrong scales do, for longer than a wheel slips."""
        return self._of_scales > SCALES_AFTER

    def disagrees(self, innovation: float, variance: float) -> bool:
        """Is the turn that the wheels do not explain (rad/s) more than noise?"""
        return abs(innovation) > LEAST_TURN and innovation * innovation > GATE * variance

    def is_unsure(self, innovation: float, variance: float, of_gyro: float) -> bool:
        """May a wheel slip: one did a moment ago, or the gyro's rate changes too fast to be dated, as where a
        robot is turned by what it runs into?

        of_gyro: (rad/s)^2 of the turn rate for that.
        """
        if self._since < AFTERMATH:
            return True
        unlike = innovation * innovation > max(LEAST_TURN**2, SOFT_GATE * variance)
        return unlike and of_gyro > DOUBTFUL_GYRO**2

    def rest(self) -> None:
        """The robot stands: what comes is another motion."""
        self._agreed = 0.0
        self.slipped = False

    def calm(self, span: float, driven: bool) -> None:
        """Wheels and gyro agreed over `span` s. driven: the wheels turned."""
        self._since += span
        if driven and not self.slipped:
            self._agreed += span
        if self._seconds == 0.0:
            return
        self._calm += span
        if self._calm > 2.0 * NAMED_AFTER:
            self.start_again()

    def blame(self, span: float, innovation: float, left: float, right: float, scales: bool) -> str:
        """The wheel to distrust over `span` s. innovation: rad/s more than the wheels say; speeds rad/s.
        scales: whether it may be the scales as well.
        """
        suspect = slipping_wheel(innovation, left, right)
        if suspect != self._suspect:
            self._seconds = self._of_scales = 0.0
            self._suspect = suspect
        self._seconds += span
        self._of_scales = self._of_scales + span if scales and self._agreed < BEGUN_WELL else 0.0
        self._calm = self._since = 0.0
        if self._seconds > NAMED_AFTER:
            self.wheel = suspect
            self.slipped = self._agreed >= BEGUN_WELL
        return suspect

    def start_again(self) -> None:
        """Forget the disagreement."""
        self._seconds = self._of_scales = 0.0
        self.wheel = self._suspect = None


def scales_explain(turn: float, left: float, right: float) -> bool:
    """Whether wrong scales of the wheels may be why they do not turn the robot as the gyro says.

    turn: by the gyro, as the difference of the wheels that would make it. left, right: what they read at the
    nominal scale, without offsets; all in rad/s. By the model of the filter the rest is
    balance (left + right) + (wheel_turn - 1) turn; only one of both is far off.
    """
    return abs(right - left - turn) < max(MOST_SCALE * abs(left + right), MOST_TURN * abs(turn))


def scales_possible(way: float, balance: float, wheel_turn: float) -> bool:
    """Whether robot.toml may be that wrong about wheels and track width (states of the filter)."""
    off = max(abs(way - 1.0), abs(balance))
    return off <= MOST_SCALE and abs(wheel_turn - 1.0) <= MOST_TURN


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


def could_be_either(innovation: float, left: float, right: float) -> bool:
    """Whether nothing tells which wheel slips: both turn, each its own way, and read too much of that."""
    return min(left * innovation, -right * innovation) > RESTING_SPEED * abs(innovation)
