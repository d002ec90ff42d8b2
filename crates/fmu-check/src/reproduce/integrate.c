/* Integrates an FMU in Model Exchange by Euler's method or the classical Runge-Kutta method, with steps of a fixed size and with events. */

/* Reads a vector; returns the status. */
static int vector(void *c, const char *name, double *x, int count) {
    return count ? ((int (*)(void *, double *, size_t))function(name))(c, x, (size_t)count) : 0;
}

/* Sets the time and, if there are states, the states; returns the status. */
static int set(void *c, double time, const double *x, int count) {
    int status = ((int (*)(void *, double))function(FMI == 3 ? "fmi3SetTime" : "fmi2SetTime"))(c, time);
    if (status > 1 || !count) return status;
    return ((int (*)(void *, const double *, size_t))function(FMI == 3 ? "fmi3SetContinuousStates" : "fmi2SetContinuousStates"))(c, x, (size_t)count);
}

/* Advances by a step from the states x to the states y; k has room for the derivatives at all stages. */
static int advance(void *c, double time, double h, bool euler, const double *x, double *k, double *y, int n) {
    static const double at[] = {0, 0.5, 0.5, 1};
    int stage, i;
    for (stage = 0; stage < (euler ? 1 : 4); stage++) {
        for (i = 0; i < n; i++) y[i] = x[i] + (stage ? h * at[stage] * k[(stage - 1) * n + i] : 0);
        if (set(c, time + h * at[stage], y, n) > 1) return 3;
        if (vector(c, FMI == 3 ? "fmi3GetContinuousStateDerivatives" : "fmi2GetDerivatives", k + stage * n, n) > 1) return 3;
    }
    for (i = 0; i < n; i++) {
        double slope = euler ? k[i] : (k[i] + 2 * (k[n + i] + k[2 * n + i]) + k[3 * n + i]) / 6;
        y[i] = x[i] + h * slope;
    }
    return set(c, time + h, y, n);
}

/* Reads the event indicators; returns whether one of them has changed its sign. */
static bool crosses(void *c, const double *z, double *now, int nz) {
    int i;
    bool found = false;
    vector(c, FMI == 3 ? "fmi3GetEventIndicators" : "fmi2GetEventIndicators", now, nz);
    for (i = 0; i < nz; i++) found |= (z[i] > 0) != (now[i] > 0);
    return found;
}

static int handle_event(void *c, double *next) {
    char flags[5];
    int64_t info[4];
    int status = ((int (*)(void *))function(FMI == 3 ? "fmi3EnterEventMode" : "fmi2EnterEventMode"))(c);
    if (status > 1) return status;
#if FMI == 2
    (void)flags;
    (void)next;
    status = update_states(c, info);
#else
    (void)info;
    status = update_states(c, flags, flags + 1, flags + 2, flags + 3, flags + 4, next);
#endif
    if (status > 1) return status;
    return ((int (*)(void *))function(FMI == 3 ? "fmi3EnterContinuousTimeMode" : "fmi2EnterContinuousTimeMode"))(c);
}

static int integrate(void *c, double begin, double end, int steps, bool euler, int n, int nz, double *events) {
    double size = (end - begin) / steps, close = 1e-9 * size, time = begin, unused;
    double *room = calloc((size_t)(6 * n + 2 * nz + 1), sizeof *room), *x = room, *y = x + n, *k = y + n, *z = k + 4 * n, *now = z + nz;
    int status = 0;
    /* The times of the first and the last event, and the number of events other than time events. */
    events[0] = events[1] = INFINITY;
    events[2] = 0;
    while (time < end - close && status < 2) {
        double next = *next_event(c), until = fmin(fmin(time + size, end), fmax(next, time)), h = until - time;
        bool event = false;
        int32_t flags[2] = {0, 0};
        if (h > 0) {
            vector(c, FMI == 3 ? "fmi3GetContinuousStates" : "fmi2GetContinuousStates", x, n);
            crosses(c, z, z, nz);
            status = advance(c, time, h, euler, x, k, y, n);
            event = crosses(c, z, now, nz);
            if (event) {
                double low = 0;
                int i;
                for (i = 0; i < 40; i++) {
                    double middle = (low + h) / 2;
                    advance(c, time, middle, euler, x, k, y, n);
                    if (crosses(c, z, now, nz)) h = middle; else low = middle;
                }
                advance(c, time, h, euler, x, k, y, n);
            }
        }
        time += h;
        if (!event) {
            time = end - until < close ? end : until;
            set(c, time, NULL, 0);
        }
#if FMI == 2
        status = ((int (*)(void *, int, int32_t *, int32_t *))function("fmi2CompletedIntegratorStep"))(c, 1, &flags[0], &flags[1]);
#else
        status = ((int (*)(void *, bool, bool *, bool *))function("fmi3CompletedIntegratorStep"))(c, true, (bool *)&flags[0], (bool *)&flags[1]);
#endif
        if (flags[1]) status = 2;
        if (status < 2 && (event || flags[0] || next <= time)) {
            events[1] = time;
            if (events[0] == INFINITY) events[0] = time;
            events[2] += event || flags[0];
            status = handle_event(c, &unused);
        }
    }
    print("integrated to %.17g: %d\n", end, status);
    free(room);
    return status;
}

