/* Table 1, eq. (11) and the value references of the FMU, for bare_exact.c and euler.c.
 * The code is derived from the paper and shares nothing with the FMU. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { THETA1, THETA2, OMEGA1, OMEGA2, TAU1, TAU2, PITCH, ROLL, PITCH_RATE, ROLL_RATE, THETA3, USE_OMEGA = 33 };

/* x' = A x + B u, y = C x + D u with u = [theta1, theta2, omega1, omega2] and
 * y = [tau1, tau2, pitch, roll, pitch_rate, roll_rate]. */
typedef struct {
    double A[6][6], B[6][4], C[6][6], D[6][4];
} System;

static void make_system(System *s) {
    const double deg = 180.0 / 3.14159265358979323846;
    const double J2 = 3.8681291e-3, J3 = 1.2750004e-2, H3 = 4.2363841e-2, M = 4, N = 7;
    const double k1 = 2.11 * deg, k2 = 0.76 * deg, c1 = 7.83e-3 * deg, c2 = 8.35e-3 * deg, c3 = 6.66e-3 * deg;
    const double c = c1 + c2, r = N / (2 * M);
    memset(s, 0, sizeof *s);
    for (int i = 0; i < 2; i++) {
        s->A[i][i] = -(k1 + k2) / c, s->A[i][2 + i] = k2 / c, s->A[i][4 + i] = c2 / c;
        s->B[i][i] = k1 / c, s->B[i][2 + i] = c1 / c;
        s->A[2 + i][4 + i] = 1;
        for (int j = 0; j < 6; j++) s->C[i][j] = c1 * s->A[i][j];
        for (int j = 0; j < 4; j++) s->D[i][j] = c1 * s->B[i][j];
        s->C[i][i] += k1, s->D[i][i] -= k1, s->D[i][2 + i] -= c1;
    }
    /* torques on theta5 and theta6; the first is c2 (theta3' - omega5) + k2 (theta3 - theta5) - load damping */
    double F[2][6], G[2][4];
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 6; j++) F[i][j] = c2 * s->A[i][j];
        for (int j = 0; j < 4; j++) G[i][j] = c2 * s->B[i][j];
        F[i][i] += k2, F[i][2 + i] -= k2;
        F[i][4 + i] -= c2 + c3 / 4 + c3 * r * r, F[i][5 - i] -= c3 / 4 - c3 * r * r;
    }
    const double m = J2 + H3 / 4 + J3 * r * r, n = H3 / 4 - J3 * r * r, det = m * m - n * n;
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 6; j++) s->A[4 + i][j] = (m * F[i][j] - n * F[1 - i][j]) / det;
        for (int j = 0; j < 4; j++) s->B[4 + i][j] = (m * G[i][j] - n * G[1 - i][j]) / det;
    }
    s->C[2][2] = s->C[2][3] = s->C[4][4] = s->C[4][5] = 0.5;
    s->C[3][2] = s->C[5][4] = r, s->C[3][3] = s->C[5][5] = -r;
}
