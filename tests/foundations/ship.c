/* A ship of one screw and one rudder as an FMU of FMI 2.0 or 3.0, with declarations of its own.

   u' = K_T n |n| - X_uu u |u|,  T r' = K u delta - r,  v = -b r,  Euler steps of at most 0.05 s.
   The variables are those of another school: east and north, speeds in knots, degrees to port. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846
#define KNOT (1852.0 / 3600.0)

enum { X, Y, YAW, SURGE, SWAY, RATE, RUDDER, RPM, K_T, X_UU, T_, K_, B_, SURGE_0, RATE_0, YAW_0, FAULT, COUNT };
/* FAULT, after 5 s: 1 an error, with its reason if there is a log, 6 a place that is no number, 2 ends the process, 3 hangs, 4 prints and goes on, 5 an error at the start */

typedef struct { double value[COUNT], time; int begun; } Ship;

static const double begin[COUNT] = { [K_T] = 0.02, [X_UU] = 0.003, [T_] = 12.0, [K_] = 0.06, [B_] = 8.0 };

static int logged = 0;

static int start_ship(Ship *s)
{
    double *x = s->value;
#ifdef STARTS
    x[SURGE] = x[SURGE_0];
    x[RATE] = x[RATE_0];
    x[YAW] = x[YAW_0];
    x[SWAY] = -1 * x[B_] * x[RATE] * PI / 180 / KNOT;
#endif
    s->begun = 1;
    return x[FAULT] == 5 ? 3 : 0;
}

static int step_ship(Ship *s, double h)
{
    double *x = s->value;
    int i, n = (int)ceil(h / 0.05 - 1e-9);
    for (i = 0; i < n; ++i) {
        double d = h / n, u = x[SURGE] * KNOT, r = x[RATE] * PI / 180, a = x[YAW] * PI / 180, v = -x[B_] * r;
        double rps = x[RPM] / 60; /* counter-clockwise: positive to port; v to port too */
        x[X] += d * (u * cos(a) - v * sin(a));
        x[Y] += d * (u * sin(a) + v * cos(a));
        x[YAW] += d * x[RATE];
        x[SURGE] += d * (x[K_T] * rps * fabs(rps) - x[X_UU] * u * fabs(u)) / KNOT;
        x[RATE] += d * (x[K_] * u * x[RUDDER] * PI / 180 - r) / x[T_] * 180 / PI;
        x[SWAY] = -x[B_] * x[RATE] * PI / 180 / KNOT;
    }
    s->time += h;
    if (s->time > 5) switch ((int)x[FAULT]) {
        case 1:
            if (logged) printf("the propeller is lost\n"), fflush(stdout);
            return 3;
        case 6: x[X] = NAN; break;
        case 2: exit(1);
        case 3: for (;;) continue;
        case 4: for (i = 0; i < 100; ++i) printf("nobody reads this line\n");
    }
    return 0;
}

static int set_values(Ship *s, const uint32_t *at, size_t n, const double *given)
{
    size_t i;
    for (i = 0; i < n; ++i) s->value[at[i]] = given[i];
    return 0;
}

static int get_values(Ship *s, const uint32_t *at, size_t n, double *out)
{
    size_t i;
    for (i = 0; i < n; ++i) out[i] = s->value[at[i]];
    return 0;
}

static Ship *new_ship(void)
{
    Ship *s = calloc(1, sizeof *s);
    memcpy(s->value, begin, sizeof begin);
    return s;
}

static int reset_ship(Ship *s)
{
#ifdef NO_RESET
    return 3;
#else
    memset(s, 0, sizeof *s);
    memcpy(s->value, begin, sizeof begin);
    return 0;
#endif
}

static int copy_ship(Ship *s, Ship **kept)
{
    if (!*kept) *kept = malloc(sizeof *s);
    memcpy(*kept, s, sizeof *s);
    return 0;
}

static int free_copy(Ship **kept)
{
    free(*kept);
    *kept = 0;
    return 0;
}

#if FMI == 2
void *fmi2Instantiate(const char *a, int b, const char *c, const char *d, const void *e, int f, int g)
{
    logged = g;
    return new_ship();
}
void fmi2FreeInstance(void *s) { free(s); }
int fmi2SetupExperiment(void *s, int a, double b, double c, int d, double e) { return 0; }
int fmi2EnterInitializationMode(void *s) { return 0; }
int fmi2ExitInitializationMode(void *s) { return start_ship(s); }
int fmi2Reset(void *s) { return reset_ship(s); }
int fmi2SetReal(void *s, const uint32_t *at, size_t n, const double *x) { return set_values(s, at, n, x); }
int fmi2GetReal(void *s, const uint32_t *at, size_t n, double *x) { return get_values(s, at, n, x); }
int fmi2DoStep(void *s, double t, double h, int a) { return step_ship(s, h); }
int fmi2GetFMUstate(void *s, Ship **kept) { return copy_ship(s, kept); }
int fmi2SetFMUstate(void *s, Ship *kept) { memcpy(s, kept, sizeof(Ship)); return 0; }
int fmi2FreeFMUstate(void *s, Ship **kept) { return free_copy(kept); }
#else
#include <stdbool.h>
void *fmi3InstantiateCoSimulation(const char *a, const char *b, const char *c, bool d, bool e, bool f, bool g,
    const uint32_t *h, size_t i, void *j, void *k, void *l) { return new_ship(); }
void fmi3FreeInstance(void *s) { free(s); }
int fmi3EnterInitializationMode(void *s, bool a, double b, double c, bool d, double e) { return 0; }
int fmi3ExitInitializationMode(void *s) { return start_ship(s); }
int fmi3Reset(void *s) { return reset_ship(s); }
int fmi3SetFloat64(void *s, const uint32_t *at, size_t n, const double *x, size_t m) { return set_values(s, at, n, x); }
int fmi3GetFloat64(void *s, const uint32_t *at, size_t n, double *x, size_t m) { return get_values(s, at, n, x); }
int fmi3DoStep(void *s, double t, double h, bool a, bool *event, bool *end, bool *early, double *last)
{
    *event = *end = *early = 0;
    *last = t + h;
    return step_ship(s, h);
}
int fmi3GetFMUState(void *s, Ship **kept) { return copy_ship(s, kept); }
int fmi3SetFMUState(void *s, Ship *kept) { memcpy(s, kept, sizeof(Ship)); return 0; }
int fmi3FreeFMUState(void *s, Ship **kept) { return free_copy(kept); }
#endif
