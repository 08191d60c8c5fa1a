"""The drive filter's predict and update, unrolled. Written by `ekf/generate.py`: edit the
model there.

Each function takes and gives the flat state: the named states of `state.State`, then the upper
triangle of their covariance by rows. `update` also gives (innovation, variance of it) of each measurement.
"""

from __future__ import annotations

from math import cos, sin

# fmt: off
Flat = tuple[float, ...]


def predict(
    state: Flat, dt: float, q_velocity: float, q_turn_rate: float, q_gyro_bias: float, q_offset: float,
        q_scale: float
) -> Flat:
    """Move on by dt."""
    (x, y, heading, velocity, turn_rate, gyro_bias, left_offset, right_offset, way, balance, wheel_turn,
        gyro_scale, gyro_delay, p0_0, p0_1, p0_2, p0_3, p0_4, p0_5, p0_6, p0_7, p0_8, p0_9, p0_10, p0_11,
        p0_12, p1_1, p1_2, p1_3, p1_4, p1_5, p1_6, p1_7, p1_8, p1_9, p1_10, p1_11, p1_12, p2_2, p2_3, p2_4,
        p2_5, p2_6, p2_7, p2_8, p2_9, p2_10, p2_11, p2_12, p3_3, p3_4, p3_5, p3_6, p3_7, p3_8, p3_9, p3_10,
        p3_11, p3_12, p4_4, p4_5, p4_6, p4_7, p4_8, p4_9, p4_10, p4_11, p4_12, p5_5, p5_6, p5_7, p5_8, p5_9,
        p5_10, p5_11, p5_12, p6_6, p6_7, p6_8, p6_9, p6_10, p6_11, p6_12, p7_7, p7_8, p7_9, p7_10, p7_11,
        p7_12, p8_8, p8_9, p8_10, p8_11, p8_12, p9_9, p9_10, p9_11, p9_12, p10_10, p10_11, p10_12, p11_11,
        p11_12, p12_12,) = (state)
    p3_3 += q_velocity
    p4_4 += q_turn_rate
    p5_5 += q_gyro_bias
    p6_6 += q_offset
    p7_7 += q_offset
    p8_8 += q_scale
    p9_9 += q_scale
    p10_10 += q_scale
    p8_10 -= q_scale
    middle = heading + 0.5 * dt * turn_rate
    along_x = dt * cos(middle)
    along_y = dt * sin(middle)
    f0_2 = -along_y*velocity*way
    f0_3 = along_x*way
    f0_4 = -1/2*along_y*dt*velocity*way
    f0_8 = along_x*velocity
    f1_2 = along_x*velocity*way
    f1_3 = along_y*way
    f1_4 = (1/2)*along_x*dt*velocity*way
    f1_8 = along_y*velocity
    f2_4 = dt
    b0_0 = p0_0 + f0_2 * p0_2 + f0_3 * p0_3 + f0_4 * p0_4 + f0_8 * p0_8
    b0_1 = p0_1 + f0_2 * p1_2 + f0_3 * p1_3 + f0_4 * p1_4 + f0_8 * p1_8
    b0_2 = p0_2 + f0_2 * p2_2 + f0_3 * p2_3 + f0_4 * p2_4 + f0_8 * p2_8
    b0_3 = p0_3 + f0_2 * p2_3 + f0_3 * p3_3 + f0_4 * p3_4 + f0_8 * p3_8
    b0_4 = p0_4 + f0_2 * p2_4 + f0_3 * p3_4 + f0_4 * p4_4 + f0_8 * p4_8
    b0_5 = p0_5 + f0_2 * p2_5 + f0_3 * p3_5 + f0_4 * p4_5 + f0_8 * p5_8
    b0_6 = p0_6 + f0_2 * p2_6 + f0_3 * p3_6 + f0_4 * p4_6 + f0_8 * p6_8
    b0_7 = p0_7 + f0_2 * p2_7 + f0_3 * p3_7 + f0_4 * p4_7 + f0_8 * p7_8
    b0_8 = p0_8 + f0_2 * p2_8 + f0_3 * p3_8 + f0_4 * p4_8 + f0_8 * p8_8
    b0_9 = p0_9 + f0_2 * p2_9 + f0_3 * p3_9 + f0_4 * p4_9 + f0_8 * p8_9
    b0_10 = p0_10 + f0_2 * p2_10 + f0_3 * p3_10 + f0_4 * p4_10 + f0_8 * p8_10
    b0_11 = p0_11 + f0_2 * p2_11 + f0_3 * p3_11 + f0_4 * p4_11 + f0_8 * p8_11
    b0_12 = p0_12 + f0_2 * p2_12 + f0_3 * p3_12 + f0_4 * p4_12 + f0_8 * p8_12
    b1_1 = p1_1 + f1_2 * p1_2 + f1_3 * p1_3 + f1_4 * p1_4 + f1_8 * p1_8
    b1_2 = p1_2 + f1_2 * p2_2 + f1_3 * p2_3 + f1_4 * p2_4 + f1_8 * p2_8
    b1_3 = p1_3 + f1_2 * p2_3 + f1_3 * p3_3 + f1_4 * p3_4 + f1_8 * p3_8
    b1_4 = p1_4 + f1_2 * p2_4 + f1_3 * p3_4 + f1_4 * p4_4 + f1_8 * p4_8
    b1_5 = p1_5 + f1_2 * p2_5 + f1_3 * p3_5 + f1_4 * p4_5 + f1_8 * p5_8
    b1_6 = p1_6 + f1_2 * p2_6 + f1_3 * p3_6 + f1_4 * p4_6 + f1_8 * p6_8
    b1_7 = p1_7 + f1_2 * p2_7 + f1_3 * p3_7 + f1_4 * p4_7 + f1_8 * p7_8
    b1_8 = p1_8 + f1_2 * p2_8 + f1_3 * p3_8 + f1_4 * p4_8 + f1_8 * p8_8
    b1_9 = p1_9 + f1_2 * p2_9 + f1_3 * p3_9 + f1_4 * p4_9 + f1_8 * p8_9
    b1_10 = p1_10 + f1_2 * p2_10 + f1_3 * p3_10 + f1_4 * p4_10 + f1_8 * p8_10
    b1_11 = p1_11 + f1_2 * p2_11 + f1_3 * p3_11 + f1_4 * p4_11 + f1_8 * p8_11
    b1_12 = p1_12 + f1_2 * p2_12 + f1_3 * p3_12 + f1_4 * p4_12 + f1_8 * p8_12
    b2_2 = p2_2 + f2_4 * p2_4
    b2_3 = p2_3 + f2_4 * p3_4
    b2_4 = p2_4 + f2_4 * p4_4
    b2_5 = p2_5 + f2_4 * p4_5
    b2_6 = p2_6 + f2_4 * p4_6
    b2_7 = p2_7 + f2_4 * p4_7
    b2_8 = p2_8 + f2_4 * p4_8
    b2_9 = p2_9 + f2_4 * p4_9
    b2_10 = p2_10 + f2_4 * p4_10
    b2_11 = p2_11 + f2_4 * p4_11
    b2_12 = p2_12 + f2_4 * p4_12
    p0_3 = b0_3
    p0_4 = b0_4
    p0_5 = b0_5
    p0_6 = b0_6
    p0_7 = b0_7
    p0_8 = b0_8
    p0_9 = b0_9
    p0_10 = b0_10
    p0_11 = b0_11
    p0_12 = b0_12
    p1_3 = b1_3
    p1_4 = b1_4
    p1_5 = b1_5
    p1_6 = b1_6
    p1_7 = b1_7
    p1_8 = b1_8
    p1_9 = b1_9
    p1_10 = b1_10
    p1_11 = b1_11
    p1_12 = b1_12
    p2_3 = b2_3
    p2_4 = b2_4
    p2_5 = b2_5
    p2_6 = b2_6
    p2_7 = b2_7
    p2_8 = b2_8
    p2_9 = b2_9
    p2_10 = b2_10
    p2_11 = b2_11
    p2_12 = b2_12
    p0_0 = b0_0 + f0_2 * b0_2 + f0_3 * b0_3 + f0_4 * b0_4 + f0_8 * b0_8
    p0_1 = b0_1 + f1_2 * b0_2 + f1_3 * b0_3 + f1_4 * b0_4 + f1_8 * b0_8
    p0_2 = b0_2 + f2_4 * b0_4
    p1_1 = b1_1 + f1_2 * b1_2 + f1_3 * b1_3 + f1_4 * b1_4 + f1_8 * b1_8
    p1_2 = b1_2 + f2_4 * b1_4
    p2_2 = b2_2 + f2_4 * b2_4
    x += way * velocity * along_x
    y += way * velocity * along_y
    heading += dt * turn_rate
    return (x, y, heading, velocity, turn_rate, gyro_bias, left_offset, right_offset, way, balance,
        wheel_turn, gyro_scale, gyro_delay, p0_0, p0_1, p0_2, p0_3, p0_4, p0_5, p0_6, p0_7, p0_8, p0_9,
        p0_10, p0_11, p0_12, p1_1, p1_2, p1_3, p1_4, p1_5, p1_6, p1_7, p1_8, p1_9, p1_10, p1_11, p1_12,
        p2_2, p2_3, p2_4, p2_5, p2_6, p2_7, p2_8, p2_9, p2_10, p2_11, p2_12, p3_3, p3_4, p3_5, p3_6, p3_7,
        p3_8, p3_9, p3_10, p3_11, p3_12, p4_4, p4_5, p4_6, p4_7, p4_8, p4_9, p4_10, p4_11, p4_12, p5_5,
        p5_6, p5_7, p5_8, p5_9, p5_10, p5_11, p5_12, p6_6, p6_7, p6_8, p6_9, p6_10, p6_11, p6_12, p7_7,
        p7_8, p7_9, p7_10, p7_11, p7_12, p8_8, p8_9, p8_10, p8_11, p8_12, p9_9, p9_10, p9_11, p9_12, p10_10,
        p10_11, p10_12, p11_11, p11_12, p12_12)


def update(
    state: Flat, z_left: float, r_left: float, z_right: float, r_right: float, z_gyro: float | None, r_gyro:
        float, turn_acceleration: float, r_differential: float, radius: float, half_track: float
) -> tuple[Flat, Flat]:
    """Both wheels read, and the gyro where it is not None."""
    (x, y, heading, velocity, turn_rate, gyro_bias, left_offset, right_offset, way, balance, wheel_turn,
        gyro_scale, gyro_delay, p0_0, p0_1, p0_2, p0_3, p0_4, p0_5, p0_6, p0_7, p0_8, p0_9, p0_10, p0_11,
        p0_12, p1_1, p1_2, p1_3, p1_4, p1_5, p1_6, p1_7, p1_8, p1_9, p1_10, p1_11, p1_12, p2_2, p2_3, p2_4,
        p2_5, p2_6, p2_7, p2_8, p2_9, p2_10, p2_11, p2_12, p3_3, p3_4, p3_5, p3_6, p3_7, p3_8, p3_9, p3_10,
        p3_11, p3_12, p4_4, p4_5, p4_6, p4_7, p4_8, p4_9, p4_10, p4_11, p4_12, p5_5, p5_6, p5_7, p5_8, p5_9,
        p5_10, p5_11, p5_12, p6_6, p6_7, p6_8, p6_9, p6_10, p6_11, p6_12, p7_7, p7_8, p7_9, p7_10, p7_11,
        p7_12, p8_8, p8_9, p8_10, p8_11, p8_12, p9_9, p9_10, p9_11, p9_12, p10_10, p10_11, p10_12, p11_11,
        p11_12, p12_12,) = (state)
    inverse_radius = 1.0 / radius
    shared = -r_differential / (r_left + r_differential)
    wheels_turn = gyro_delay*turn_acceleration + turn_rate
    telling_velocity = velocity if abs(velocity) > 0.02 else 0.0
    telling_turn = wheels_turn if abs(turn_rate) > 0.1 else 0.0
    y_left = (z_left - (inverse_radius*(1 - balance)*(-half_track*wheel_turn*wheels_turn + velocity) +
        left_offset))
    h_left_3 = inverse_radius*(1 - balance)
    h_left_4 = -half_track*inverse_radius*wheel_turn*(1 - balance)
    h_left_9 = -inverse_radius*(-half_track*wheel_turn*wheels_turn + telling_velocity)
    h_left_10 = -half_track*inverse_radius*telling_turn*(1 - balance)
    h_left_12 = -half_track*inverse_radius*turn_acceleration*wheel_turn*(1 - balance)
    y_right = (z_right - (inverse_radius*(balance + 1)*(half_track*wheel_turn*wheels_turn + velocity) +
        right_offset))
    h_right_3 = inverse_radius*(balance + 1) - shared * h_left_3
    h_right_4 = half_track*inverse_radius*wheel_turn*(balance + 1) - shared * h_left_4
    h_right_6 = -shared
    h_right_9 = (inverse_radius*(half_track*wheel_turn*wheels_turn + telling_velocity) - shared * h_left_9)
    h_right_10 = half_track*inverse_radius*telling_turn*(balance + 1) - shared * h_left_10
    h_right_12 = (half_track*inverse_radius*turn_acceleration*wheel_turn*(balance + 1) - shared * h_left_12)
    y_right -= shared * y_left
    g0 = (h_left_3 * p0_3 + h_left_4 * p0_4 + p0_6 + h_left_9 * p0_9 + h_left_10 * p0_10 + h_left_12 *
        p0_12)
    g1 = (h_left_3 * p1_3 + h_left_4 * p1_4 + p1_6 + h_left_9 * p1_9 + h_left_10 * p1_10 + h_left_12 *
        p1_12)
    g2 = (h_left_3 * p2_3 + h_left_4 * p2_4 + p2_6 + h_left_9 * p2_9 + h_left_10 * p2_10 + h_left_12 *
        p2_12)
    g3 = (h_left_3 * p3_3 + h_left_4 * p3_4 + p3_6 + h_left_9 * p3_9 + h_left_10 * p3_10 + h_left_12 *
        p3_12)
    g4 = (h_left_3 * p3_4 + h_left_4 * p4_4 + p4_6 + h_left_9 * p4_9 + h_left_10 * p4_10 + h_left_12 *
        p4_12)
    g5 = (h_left_3 * p3_5 + h_left_4 * p4_5 + p5_6 + h_left_9 * p5_9 + h_left_10 * p5_10 + h_left_12 *
        p5_12)
    g6 = (h_left_3 * p3_6 + h_left_4 * p4_6 + p6_6 + h_left_9 * p6_9 + h_left_10 * p6_10 + h_left_12 *
        p6_12)
    g7 = (h_left_3 * p3_7 + h_left_4 * p4_7 + p6_7 + h_left_9 * p7_9 + h_left_10 * p7_10 + h_left_12 *
        p7_12)
    g8 = (h_left_3 * p3_8 + h_left_4 * p4_8 + p6_8 + h_left_9 * p8_9 + h_left_10 * p8_10 + h_left_12 *
        p8_12)
    g9 = (h_left_3 * p3_9 + h_left_4 * p4_9 + p6_9 + h_left_9 * p9_9 + h_left_10 * p9_10 + h_left_12 *
        p9_12)
    g10 = (h_left_3 * p3_10 + h_left_4 * p4_10 + p6_10 + h_left_9 * p9_10 + h_left_10 * p10_10 + h_left_12 *
        p10_12)
    g11 = (h_left_3 * p3_11 + h_left_4 * p4_11 + p6_11 + h_left_9 * p9_11 + h_left_10 * p10_11 + h_left_12 *
        p11_12)
    g12 = (h_left_3 * p3_12 + h_left_4 * p4_12 + p6_12 + h_left_9 * p9_12 + h_left_10 * p10_12 + h_left_12 *
        p12_12)
    s_left = (h_left_3 * g3 + h_left_4 * g4 + g6 + h_left_9 * g9 + h_left_10 * g10 + h_left_12 * g12 +
        r_left + r_differential)
    w = 1.0 / s_left
    k0 = g0 * w
    k1 = g1 * w
    k2 = g2 * w
    k3 = g3 * w
    k4 = g4 * w
    k5 = g5 * w
    k6 = g6 * w
    k7 = g7 * w
    k8 = g8 * w
    k9 = g9 * w
    k10 = g10 * w
    k11 = g11 * w
    k12 = g12 * w
    d0 = k0 * y_left
    d1 = k1 * y_left
    d2 = k2 * y_left
    d3 = k3 * y_left
    d4 = k4 * y_left
    d5 = k5 * y_left
    d6 = k6 * y_left
    d7 = k7 * y_left
    d8 = k8 * y_left
    d9 = k9 * y_left
    d10 = k10 * y_left
    d11 = k11 * y_left
    d12 = k12 * y_left
    p0_0 -= k0 * g0
    p0_1 -= k0 * g1
    p0_2 -= k0 * g2
    p0_3 -= k0 * g3
    p0_4 -= k0 * g4
    p0_5 -= k0 * g5
    p0_6 -= k0 * g6
    p0_7 -= k0 * g7
    p0_8 -= k0 * g8
    p0_9 -= k0 * g9
    p0_10 -= k0 * g10
    p0_11 -= k0 * g11
    p0_12 -= k0 * g12
    p1_1 -= k1 * g1
    p1_2 -= k1 * g2
    p1_3 -= k1 * g3
    p1_4 -= k1 * g4
    p1_5 -= k1 * g5
    p1_6 -= k1 * g6
    p1_7 -= k1 * g7
    p1_8 -= k1 * g8
    p1_9 -= k1 * g9
    p1_10 -= k1 * g10
    p1_11 -= k1 * g11
    p1_12 -= k1 * g12
    p2_2 -= k2 * g2
    p2_3 -= k2 * g3
    p2_4 -= k2 * g4
    p2_5 -= k2 * g5
    p2_6 -= k2 * g6
    p2_7 -= k2 * g7
    p2_8 -= k2 * g8
    p2_9 -= k2 * g9
    p2_10 -= k2 * g10
    p2_11 -= k2 * g11
    p2_12 -= k2 * g12
    p3_3 -= k3 * g3
    p3_4 -= k3 * g4
    p3_5 -= k3 * g5
    p3_6 -= k3 * g6
    p3_7 -= k3 * g7
    p3_8 -= k3 * g8
    p3_9 -= k3 * g9
    p3_10 -= k3 * g10
    p3_11 -= k3 * g11
    p3_12 -= k3 * g12
    p4_4 -= k4 * g4
    p4_5 -= k4 * g5
    p4_6 -= k4 * g6
    p4_7 -= k4 * g7
    p4_8 -= k4 * g8
    p4_9 -= k4 * g9
    p4_10 -= k4 * g10
    p4_11 -= k4 * g11
    p4_12 -= k4 * g12
    p5_5 -= k5 * g5
    p5_6 -= k5 * g6
    p5_7 -= k5 * g7
    p5_8 -= k5 * g8
    p5_9 -= k5 * g9
    p5_10 -= k5 * g10
    p5_11 -= k5 * g11
    p5_12 -= k5 * g12
    p6_6 -= k6 * g6
    p6_7 -= k6 * g7
    p6_8 -= k6 * g8
    p6_9 -= k6 * g9
    p6_10 -= k6 * g10
    p6_11 -= k6 * g11
    p6_12 -= k6 * g12
    p7_7 -= k7 * g7
    p7_8 -= k7 * g8
    p7_9 -= k7 * g9
    p7_10 -= k7 * g10
    p7_11 -= k7 * g11
    p7_12 -= k7 * g12
    p8_8 -= k8 * g8
    p8_9 -= k8 * g9
    p8_10 -= k8 * g10
    p8_11 -= k8 * g11
    p8_12 -= k8 * g12
    p9_9 -= k9 * g9
    p9_10 -= k9 * g10
    p9_11 -= k9 * g11
    p9_12 -= k9 * g12
    p10_10 -= k10 * g10
    p10_11 -= k10 * g11
    p10_12 -= k10 * g12
    p11_11 -= k11 * g11
    p11_12 -= k11 * g12
    p12_12 -= k12 * g12
    g0 = (h_right_3 * p0_3 + h_right_4 * p0_4 + h_right_6 * p0_6 + h_right_9 * p0_9 + h_right_10 * p0_10 +
        h_right_12 * p0_12 + p0_7)
    g1 = (h_right_3 * p1_3 + h_right_4 * p1_4 + h_right_6 * p1_6 + h_right_9 * p1_9 + h_right_10 * p1_10 +
        h_right_12 * p1_12 + p1_7)
    g2 = (h_right_3 * p2_3 + h_right_4 * p2_4 + h_right_6 * p2_6 + h_right_9 * p2_9 + h_right_10 * p2_10 +
        h_right_12 * p2_12 + p2_7)
    g3 = (h_right_3 * p3_3 + h_right_4 * p3_4 + h_right_6 * p3_6 + h_right_9 * p3_9 + h_right_10 * p3_10 +
        h_right_12 * p3_12 + p3_7)
    g4 = (h_right_3 * p3_4 + h_right_4 * p4_4 + h_right_6 * p4_6 + h_right_9 * p4_9 + h_right_10 * p4_10 +
        h_right_12 * p4_12 + p4_7)
    g5 = (h_right_3 * p3_5 + h_right_4 * p4_5 + h_right_6 * p5_6 + h_right_9 * p5_9 + h_right_10 * p5_10 +
        h_right_12 * p5_12 + p5_7)
    g6 = (h_right_3 * p3_6 + h_right_4 * p4_6 + h_right_6 * p6_6 + h_right_9 * p6_9 + h_right_10 * p6_10 +
        h_right_12 * p6_12 + p6_7)
    g7 = (h_right_3 * p3_7 + h_right_4 * p4_7 + h_right_6 * p6_7 + h_right_9 * p7_9 + h_right_10 * p7_10 +
        h_right_12 * p7_12 + p7_7)
    g8 = (h_right_3 * p3_8 + h_right_4 * p4_8 + h_right_6 * p6_8 + h_right_9 * p8_9 + h_right_10 * p8_10 +
        h_right_12 * p8_12 + p7_8)
    g9 = (h_right_3 * p3_9 + h_right_4 * p4_9 + h_right_6 * p6_9 + h_right_9 * p9_9 + h_right_10 * p9_10 +
        h_right_12 * p9_12 + p7_9)
    g10 = (h_right_3 * p3_10 + h_right_4 * p4_10 + h_right_6 * p6_10 + h_right_9 * p9_10 + h_right_10 *
        p10_10 + h_right_12 * p10_12 + p7_10)
    g11 = (h_right_3 * p3_11 + h_right_4 * p4_11 + h_right_6 * p6_11 + h_right_9 * p9_11 + h_right_10 *
        p10_11 + h_right_12 * p11_12 + p7_11)
    g12 = (h_right_3 * p3_12 + h_right_4 * p4_12 + h_right_6 * p6_12 + h_right_9 * p9_12 + h_right_10 *
        p10_12 + h_right_12 * p12_12 + p7_12)
    s_right = (h_right_3 * g3 + h_right_4 * g4 + h_right_6 * g6 + h_right_9 * g9 + h_right_10 * g10 +
        h_right_12 * g12 + g7 + r_right + r_differential + shared * r_differential)
    y_right -= (h_right_3 * d3 + h_right_4 * d4 + h_right_6 * d6 + h_right_9 * d9 + h_right_10 * d10 +
        h_right_12 * d12 + d7)
    w = 1.0 / s_right
    k0 = g0 * w
    k1 = g1 * w
    k2 = g2 * w
    k3 = g3 * w
    k4 = g4 * w
    k5 = g5 * w
    k6 = g6 * w
    k7 = g7 * w
    k8 = g8 * w
    k9 = g9 * w
    k10 = g10 * w
    k11 = g11 * w
    k12 = g12 * w
    d0 += k0 * y_right
    d1 += k1 * y_right
    d2 += k2 * y_right
    d3 += k3 * y_right
    d4 += k4 * y_right
    d5 += k5 * y_right
    d6 += k6 * y_right
    d7 += k7 * y_right
    d8 += k8 * y_right
    d9 += k9 * y_right
    d10 += k10 * y_right
    d11 += k11 * y_right
    d12 += k12 * y_right
    p0_0 -= k0 * g0
    p0_1 -= k0 * g1
    p0_2 -= k0 * g2
    p0_3 -= k0 * g3
    p0_4 -= k0 * g4
    p0_5 -= k0 * g5
    p0_6 -= k0 * g6
    p0_7 -= k0 * g7
    p0_8 -= k0 * g8
    p0_9 -= k0 * g9
    p0_10 -= k0 * g10
    p0_11 -= k0 * g11
    p0_12 -= k0 * g12
    p1_1 -= k1 * g1
    p1_2 -= k1 * g2
    p1_3 -= k1 * g3
    p1_4 -= k1 * g4
    p1_5 -= k1 * g5
    p1_6 -= k1 * g6
    p1_7 -= k1 * g7
    p1_8 -= k1 * g8
    p1_9 -= k1 * g9
    p1_10 -= k1 * g10
    p1_11 -= k1 * g11
    p1_12 -= k1 * g12
    p2_2 -= k2 * g2
    p2_3 -= k2 * g3
    p2_4 -= k2 * g4
    p2_5 -= k2 * g5
    p2_6 -= k2 * g6
    p2_7 -= k2 * g7
    p2_8 -= k2 * g8
    p2_9 -= k2 * g9
    p2_10 -= k2 * g10
    p2_11 -= k2 * g11
    p2_12 -= k2 * g12
    p3_3 -= k3 * g3
    p3_4 -= k3 * g4
    p3_5 -= k3 * g5
    p3_6 -= k3 * g6
    p3_7 -= k3 * g7
    p3_8 -= k3 * g8
    p3_9 -= k3 * g9
    p3_10 -= k3 * g10
    p3_11 -= k3 * g11
    p3_12 -= k3 * g12
    p4_4 -= k4 * g4
    p4_5 -= k4 * g5
    p4_6 -= k4 * g6
    p4_7 -= k4 * g7
    p4_8 -= k4 * g8
    p4_9 -= k4 * g9
    p4_10 -= k4 * g10
    p4_11 -= k4 * g11
    p4_12 -= k4 * g12
    p5_5 -= k5 * g5
    p5_6 -= k5 * g6
    p5_7 -= k5 * g7
    p5_8 -= k5 * g8
    p5_9 -= k5 * g9
    p5_10 -= k5 * g10
    p5_11 -= k5 * g11
    p5_12 -= k5 * g12
    p6_6 -= k6 * g6
    p6_7 -= k6 * g7
    p6_8 -= k6 * g8
    p6_9 -= k6 * g9
    p6_10 -= k6 * g10
    p6_11 -= k6 * g11
    p6_12 -= k6 * g12
    p7_7 -= k7 * g7
    p7_8 -= k7 * g8
    p7_9 -= k7 * g9
    p7_10 -= k7 * g10
    p7_11 -= k7 * g11
    p7_12 -= k7 * g12
    p8_8 -= k8 * g8
    p8_9 -= k8 * g9
    p8_10 -= k8 * g10
    p8_11 -= k8 * g11
    p8_12 -= k8 * g12
    p9_9 -= k9 * g9
    p9_10 -= k9 * g10
    p9_11 -= k9 * g11
    p9_12 -= k9 * g12
    p10_10 -= k10 * g10
    p10_11 -= k10 * g11
    p10_12 -= k10 * g12
    p11_11 -= k11 * g11
    p11_12 -= k11 * g12
    p12_12 -= k12 * g12
    innovations: Flat = (y_left, s_left, y_right, s_right)
    if z_gyro is not None:
        telling_rate = turn_rate if abs(turn_rate) > 0.1 else 0.0
        y_gyro = z_gyro - (gyro_bias + gyro_scale*turn_rate)
        h_gyro_4 = gyro_scale
        h_gyro_11 = telling_rate
        g0 = h_gyro_4 * p0_4 + p0_5 + h_gyro_11 * p0_11
        g1 = h_gyro_4 * p1_4 + p1_5 + h_gyro_11 * p1_11
        g2 = h_gyro_4 * p2_4 + p2_5 + h_gyro_11 * p2_11
        g3 = h_gyro_4 * p3_4 + p3_5 + h_gyro_11 * p3_11
        g4 = h_gyro_4 * p4_4 + p4_5 + h_gyro_11 * p4_11
        g5 = h_gyro_4 * p4_5 + p5_5 + h_gyro_11 * p5_11
        g6 = h_gyro_4 * p4_6 + p5_6 + h_gyro_11 * p6_11
        g7 = h_gyro_4 * p4_7 + p5_7 + h_gyro_11 * p7_11
        g8 = h_gyro_4 * p4_8 + p5_8 + h_gyro_11 * p8_11
        g9 = h_gyro_4 * p4_9 + p5_9 + h_gyro_11 * p9_11
        g10 = h_gyro_4 * p4_10 + p5_10 + h_gyro_11 * p10_11
        g11 = h_gyro_4 * p4_11 + p5_11 + h_gyro_11 * p11_11
        g12 = h_gyro_4 * p4_12 + p5_12 + h_gyro_11 * p11_12
        s_gyro = h_gyro_4 * g4 + g5 + h_gyro_11 * g11 + r_gyro
        y_gyro -= h_gyro_4 * d4 + d5 + h_gyro_11 * d11
        w = 1.0 / s_gyro
        k0 = g0 * w
        k1 = g1 * w
        k2 = g2 * w
        k3 = g3 * w
        k4 = g4 * w
        k5 = g5 * w
        k6 = g6 * w
        k7 = g7 * w
        k8 = g8 * w
        k9 = g9 * w
        k10 = g10 * w
        k11 = g11 * w
        k12 = g12 * w
        d0 += k0 * y_gyro
        d1 += k1 * y_gyro
        d2 += k2 * y_gyro
        d3 += k3 * y_gyro
        d4 += k4 * y_gyro
        d5 += k5 * y_gyro
        d6 += k6 * y_gyro
        d7 += k7 * y_gyro
        d8 += k8 * y_gyro
        d9 += k9 * y_gyro
        d10 += k10 * y_gyro
        d11 += k11 * y_gyro
        d12 += k12 * y_gyro
        p0_0 -= k0 * g0
        p0_1 -= k0 * g1
        p0_2 -= k0 * g2
        p0_3 -= k0 * g3
        p0_4 -= k0 * g4
        p0_5 -= k0 * g5
        p0_6 -= k0 * g6
        p0_7 -= k0 * g7
        p0_8 -= k0 * g8
        p0_9 -= k0 * g9
        p0_10 -= k0 * g10
        p0_11 -= k0 * g11
        p0_12 -= k0 * g12
        p1_1 -= k1 * g1
        p1_2 -= k1 * g2
        p1_3 -= k1 * g3
        p1_4 -= k1 * g4
        p1_5 -= k1 * g5
        p1_6 -= k1 * g6
        p1_7 -= k1 * g7
        p1_8 -= k1 * g8
        p1_9 -= k1 * g9
        p1_10 -= k1 * g10
        p1_11 -= k1 * g11
        p1_12 -= k1 * g12
        p2_2 -= k2 * g2
        p2_3 -= k2 * g3
        p2_4 -= k2 * g4
        p2_5 -= k2 * g5
        p2_6 -= k2 * g6
        p2_7 -= k2 * g7
        p2_8 -= k2 * g8
        p2_9 -= k2 * g9
        p2_10 -= k2 * g10
        p2_11 -= k2 * g11
        p2_12 -= k2 * g12
        p3_3 -= k3 * g3
        p3_4 -= k3 * g4
        p3_5 -= k3 * g5
        p3_6 -= k3 * g6
        p3_7 -= k3 * g7
        p3_8 -= k3 * g8
        p3_9 -= k3 * g9
        p3_10 -= k3 * g10
        p3_11 -= k3 * g11
        p3_12 -= k3 * g12
        p4_4 -= k4 * g4
        p4_5 -= k4 * g5
        p4_6 -= k4 * g6
        p4_7 -= k4 * g7
        p4_8 -= k4 * g8
        p4_9 -= k4 * g9
        p4_10 -= k4 * g10
        p4_11 -= k4 * g11
        p4_12 -= k4 * g12
        p5_5 -= k5 * g5
        p5_6 -= k5 * g6
        p5_7 -= k5 * g7
        p5_8 -= k5 * g8
        p5_9 -= k5 * g9
        p5_10 -= k5 * g10
        p5_11 -= k5 * g11
        p5_12 -= k5 * g12
        p6_6 -= k6 * g6
        p6_7 -= k6 * g7
        p6_8 -= k6 * g8
        p6_9 -= k6 * g9
        p6_10 -= k6 * g10
        p6_11 -= k6 * g11
        p6_12 -= k6 * g12
        p7_7 -= k7 * g7
        p7_8 -= k7 * g8
        p7_9 -= k7 * g9
        p7_10 -= k7 * g10
        p7_11 -= k7 * g11
        p7_12 -= k7 * g12
        p8_8 -= k8 * g8
        p8_9 -= k8 * g9
        p8_10 -= k8 * g10
        p8_11 -= k8 * g11
        p8_12 -= k8 * g12
        p9_9 -= k9 * g9
        p9_10 -= k9 * g10
        p9_11 -= k9 * g11
        p9_12 -= k9 * g12
        p10_10 -= k10 * g10
        p10_11 -= k10 * g11
        p10_12 -= k10 * g12
        p11_11 -= k11 * g11
        p11_12 -= k11 * g12
        p12_12 -= k12 * g12
        innovations = (*innovations, y_gyro, s_gyro)
    x += d0
    y += d1
    heading += d2
    velocity += d3
    turn_rate += d4
    gyro_bias += d5
    left_offset += d6
    right_offset += d7
    way += d8
    balance += d9
    wheel_turn += d10
    gyro_scale += d11
    gyro_delay += d12
    return (x, y, heading, velocity, turn_rate, gyro_bias, left_offset, right_offset, way, balance,
        wheel_turn, gyro_scale, gyro_delay, p0_0, p0_1, p0_2, p0_3, p0_4, p0_5, p0_6, p0_7, p0_8, p0_9,
        p0_10, p0_11, p0_12, p1_1, p1_2, p1_3, p1_4, p1_5, p1_6, p1_7, p1_8, p1_9, p1_10, p1_11, p1_12,
        p2_2, p2_3, p2_4, p2_5, p2_6, p2_7, p2_8, p2_9, p2_10, p2_11, p2_12, p3_3, p3_4, p3_5, p3_6, p3_7,
        p3_8, p3_9, p3_10, p3_11, p3_12, p4_4, p4_5, p4_6, p4_7, p4_8, p4_9, p4_10, p4_11, p4_12, p5_5,
        p5_6, p5_7, p5_8, p5_9, p5_10, p5_11, p5_12, p6_6, p6_7, p6_8, p6_9, p6_10, p6_11, p6_12, p7_7,
        p7_8, p7_9, p7_10, p7_11, p7_12, p8_8, p8_9, p8_10, p8_11, p8_12, p9_9, p9_10, p9_11, p9_12, p10_10,
        p10_11, p10_12, p11_11, p11_12, p12_12), innovations


def update_still(
    state: Flat, r_velocity: float, r_turn_rate: float
) -> Flat:
    """The robot stands still."""
    (x, y, heading, velocity, turn_rate, gyro_bias, left_offset, right_offset, way, balance, wheel_turn,
        gyro_scale, gyro_delay, p0_0, p0_1, p0_2, p0_3, p0_4, p0_5, p0_6, p0_7, p0_8, p0_9, p0_10, p0_11,
        p0_12, p1_1, p1_2, p1_3, p1_4, p1_5, p1_6, p1_7, p1_8, p1_9, p1_10, p1_11, p1_12, p2_2, p2_3, p2_4,
        p2_5, p2_6, p2_7, p2_8, p2_9, p2_10, p2_11, p2_12, p3_3, p3_4, p3_5, p3_6, p3_7, p3_8, p3_9, p3_10,
        p3_11, p3_12, p4_4, p4_5, p4_6, p4_7, p4_8, p4_9, p4_10, p4_11, p4_12, p5_5, p5_6, p5_7, p5_8, p5_9,
        p5_10, p5_11, p5_12, p6_6, p6_7, p6_8, p6_9, p6_10, p6_11, p6_12, p7_7, p7_8, p7_9, p7_10, p7_11,
        p7_12, p8_8, p8_9, p8_10, p8_11, p8_12, p9_9, p9_10, p9_11, p9_12, p10_10, p10_11, p10_12, p11_11,
        p11_12, p12_12,) = (state)
    y_velocity = 0.0 - velocity
    y_turn_rate = 0.0 - turn_rate
    g0 = p0_3
    g1 = p1_3
    g2 = p2_3
    g3 = p3_3
    g4 = p3_4
    g5 = p3_5
    g6 = p3_6
    g7 = p3_7
    g8 = p3_8
    g9 = p3_9
    g10 = p3_10
    g11 = p3_11
    g12 = p3_12
    s_velocity = g3 + r_velocity
    w = 1.0 / s_velocity
    k0 = g0 * w
    k1 = g1 * w
    k2 = g2 * w
    k3 = g3 * w
    k4 = g4 * w
    k5 = g5 * w
    k6 = g6 * w
    k7 = g7 * w
    k8 = g8 * w
    k9 = g9 * w
    k10 = g10 * w
    k11 = g11 * w
    k12 = g12 * w
    d0 = k0 * y_velocity
    d1 = k1 * y_velocity
    d2 = k2 * y_velocity
    d3 = k3 * y_velocity
    d4 = k4 * y_velocity
    d5 = k5 * y_velocity
    d6 = k6 * y_velocity
    d7 = k7 * y_velocity
    d8 = k8 * y_velocity
    d9 = k9 * y_velocity
    d10 = k10 * y_velocity
    d11 = k11 * y_velocity
    d12 = k12 * y_velocity
    p0_0 -= k0 * g0
    p0_1 -= k0 * g1
    p0_2 -= k0 * g2
    p0_3 -= k0 * g3
    p0_4 -= k0 * g4
    p0_5 -= k0 * g5
    p0_6 -= k0 * g6
    p0_7 -= k0 * g7
    p0_8 -= k0 * g8
    p0_9 -= k0 * g9
    p0_10 -= k0 * g10
    p0_11 -= k0 * g11
    p0_12 -= k0 * g12
    p1_1 -= k1 * g1
    p1_2 -= k1 * g2
    p1_3 -= k1 * g3
    p1_4 -= k1 * g4
    p1_5 -= k1 * g5
    p1_6 -= k1 * g6
    p1_7 -= k1 * g7
    p1_8 -= k1 * g8
    p1_9 -= k1 * g9
    p1_10 -= k1 * g10
    p1_11 -= k1 * g11
    p1_12 -= k1 * g12
    p2_2 -= k2 * g2
    p2_3 -= k2 * g3
    p2_4 -= k2 * g4
    p2_5 -= k2 * g5
    p2_6 -= k2 * g6
    p2_7 -= k2 * g7
    p2_8 -= k2 * g8
    p2_9 -= k2 * g9
    p2_10 -= k2 * g10
    p2_11 -= k2 * g11
    p2_12 -= k2 * g12
    p3_3 -= k3 * g3
    p3_4 -= k3 * g4
    p3_5 -= k3 * g5
    p3_6 -= k3 * g6
    p3_7 -= k3 * g7
    p3_8 -= k3 * g8
    p3_9 -= k3 * g9
    p3_10 -= k3 * g10
    p3_11 -= k3 * g11
    p3_12 -= k3 * g12
    p4_4 -= k4 * g4
    p4_5 -= k4 * g5
    p4_6 -= k4 * g6
    p4_7 -= k4 * g7
    p4_8 -= k4 * g8
    p4_9 -= k4 * g9
    p4_10 -= k4 * g10
    p4_11 -= k4 * g11
    p4_12 -= k4 * g12
    p5_5 -= k5 * g5
    p5_6 -= k5 * g6
    p5_7 -= k5 * g7
    p5_8 -= k5 * g8
    p5_9 -= k5 * g9
    p5_10 -= k5 * g10
    p5_11 -= k5 * g11
    p5_12 -= k5 * g12
    p6_6 -= k6 * g6
    p6_7 -= k6 * g7
    p6_8 -= k6 * g8
    p6_9 -= k6 * g9
    p6_10 -= k6 * g10
    p6_11 -= k6 * g11
    p6_12 -= k6 * g12
    p7_7 -= k7 * g7
    p7_8 -= k7 * g8
    p7_9 -= k7 * g9
    p7_10 -= k7 * g10
    p7_11 -= k7 * g11
    p7_12 -= k7 * g12
    p8_8 -= k8 * g8
    p8_9 -= k8 * g9
    p8_10 -= k8 * g10
    p8_11 -= k8 * g11
    p8_12 -= k8 * g12
    p9_9 -= k9 * g9
    p9_10 -= k9 * g10
    p9_11 -= k9 * g11
    p9_12 -= k9 * g12
    p10_10 -= k10 * g10
    p10_11 -= k10 * g11
    p10_12 -= k10 * g12
    p11_11 -= k11 * g11
    p11_12 -= k11 * g12
    p12_12 -= k12 * g12
    g0 = p0_4
    g1 = p1_4
    g2 = p2_4
    g3 = p3_4
    g4 = p4_4
    g5 = p4_5
    g6 = p4_6
    g7 = p4_7
    g8 = p4_8
    g9 = p4_9
    g10 = p4_10
    g11 = p4_11
    g12 = p4_12
    s_turn_rate = g4 + r_turn_rate
    y_turn_rate -= d4
    w = 1.0 / s_turn_rate
    k0 = g0 * w
    k1 = g1 * w
    k2 = g2 * w
    k3 = g3 * w
    k4 = g4 * w
    k5 = g5 * w
    k6 = g6 * w
    k7 = g7 * w
    k8 = g8 * w
    k9 = g9 * w
    k10 = g10 * w
    k11 = g11 * w
    k12 = g12 * w
    d0 += k0 * y_turn_rate
    d1 += k1 * y_turn_rate
    d2 += k2 * y_turn_rate
    d3 += k3 * y_turn_rate
    d4 += k4 * y_turn_rate
    d5 += k5 * y_turn_rate
    d6 += k6 * y_turn_rate
    d7 += k7 * y_turn_rate
    d8 += k8 * y_turn_rate
    d9 += k9 * y_turn_rate
    d10 += k10 * y_turn_rate
    d11 += k11 * y_turn_rate
    d12 += k12 * y_turn_rate
    p0_0 -= k0 * g0
    p0_1 -= k0 * g1
    p0_2 -= k0 * g2
    p0_3 -= k0 * g3
    p0_4 -= k0 * g4
    p0_5 -= k0 * g5
    p0_6 -= k0 * g6
    p0_7 -= k0 * g7
    p0_8 -= k0 * g8
    p0_9 -= k0 * g9
    p0_10 -= k0 * g10
    p0_11 -= k0 * g11
    p0_12 -= k0 * g12
    p1_1 -= k1 * g1
    p1_2 -= k1 * g2
    p1_3 -= k1 * g3
    p1_4 -= k1 * g4
    p1_5 -= k1 * g5
    p1_6 -= k1 * g6
    p1_7 -= k1 * g7
    p1_8 -= k1 * g8
    p1_9 -= k1 * g9
    p1_10 -= k1 * g10
    p1_11 -= k1 * g11
    p1_12 -= k1 * g12
    p2_2 -= k2 * g2
    p2_3 -= k2 * g3
    p2_4 -= k2 * g4
    p2_5 -= k2 * g5
    p2_6 -= k2 * g6
    p2_7 -= k2 * g7
    p2_8 -= k2 * g8
    p2_9 -= k2 * g9
    p2_10 -= k2 * g10
    p2_11 -= k2 * g11
    p2_12 -= k2 * g12
    p3_3 -= k3 * g3
    p3_4 -= k3 * g4
    p3_5 -= k3 * g5
    p3_6 -= k3 * g6
    p3_7 -= k3 * g7
    p3_8 -= k3 * g8
    p3_9 -= k3 * g9
    p3_10 -= k3 * g10
    p3_11 -= k3 * g11
    p3_12 -= k3 * g12
    p4_4 -= k4 * g4
    p4_5 -= k4 * g5
    p4_6 -= k4 * g6
    p4_7 -= k4 * g7
    p4_8 -= k4 * g8
    p4_9 -= k4 * g9
    p4_10 -= k4 * g10
    p4_11 -= k4 * g11
    p4_12 -= k4 * g12
    p5_5 -= k5 * g5
    p5_6 -= k5 * g6
    p5_7 -= k5 * g7
    p5_8 -= k5 * g8
    p5_9 -= k5 * g9
    p5_10 -= k5 * g10
    p5_11 -= k5 * g11
    p5_12 -= k5 * g12
    p6_6 -= k6 * g6
    p6_7 -= k6 * g7
    p6_8 -= k6 * g8
    p6_9 -= k6 * g9
    p6_10 -= k6 * g10
    p6_11 -= k6 * g11
    p6_12 -= k6 * g12
    p7_7 -= k7 * g7
    p7_8 -= k7 * g8
    p7_9 -= k7 * g9
    p7_10 -= k7 * g10
    p7_11 -= k7 * g11
    p7_12 -= k7 * g12
    p8_8 -= k8 * g8
    p8_9 -= k8 * g9
    p8_10 -= k8 * g10
    p8_11 -= k8 * g11
    p8_12 -= k8 * g12
    p9_9 -= k9 * g9
    p9_10 -= k9 * g10
    p9_11 -= k9 * g11
    p9_12 -= k9 * g12
    p10_10 -= k10 * g10
    p10_11 -= k10 * g11
    p10_12 -= k10 * g12
    p11_11 -= k11 * g11
    p11_12 -= k11 * g12
    p12_12 -= k12 * g12
    x += d0
    y += d1
    heading += d2
    velocity += d3
    turn_rate += d4
    gyro_bias += d5
    left_offset += d6
    right_offset += d7
    way += d8
    balance += d9
    wheel_turn += d10
    gyro_scale += d11
    gyro_delay += d12
    return (x, y, heading, velocity, turn_rate, gyro_bias, left_offset, right_offset, way, balance,
        wheel_turn, gyro_scale, gyro_delay, p0_0, p0_1, p0_2, p0_3, p0_4, p0_5, p0_6, p0_7, p0_8, p0_9,
        p0_10, p0_11, p0_12, p1_1, p1_2, p1_3, p1_4, p1_5, p1_6, p1_7, p1_8, p1_9, p1_10, p1_11, p1_12,
        p2_2, p2_3, p2_4, p2_5, p2_6, p2_7, p2_8, p2_9, p2_10, p2_11, p2_12, p3_3, p3_4, p3_5, p3_6, p3_7,
        p3_8, p3_9, p3_10, p3_11, p3_12, p4_4, p4_5, p4_6, p4_7, p4_8, p4_9, p4_10, p4_11, p4_12, p5_5,
        p5_6, p5_7, p5_8, p5_9, p5_10, p5_11, p5_12, p6_6, p6_7, p6_8, p6_9, p6_10, p6_11, p6_12, p7_7,
        p7_8, p7_9, p7_10, p7_11, p7_12, p8_8, p8_9, p8_10, p8_11, p8_12, p9_9, p9_10, p9_11, p9_12, p10_10,
        p10_11, p10_12, p11_11, p11_12, p12_12)
