/* A valve with strings, discrete inputs and a file in its resources, for Co-Simulation. It is correct, unless FMU_TRAITS names faults.
   With the trait "unusual" it is still correct, but does what a careless check would report. */
#include "frame.h"

enum { GAIN = 1, LABEL, UNIT, OPEN, STAGE, U, LEVEL, DER_LEVEL, FLOW, COUNT, CURVE, SHARE, TIME };

struct Model {
    Fmu fmu;
    double level, gain, u;
    int open, stage;
    char text[2][200];
    double curve;
    char buffer[2][200];
};

static char buffer_of_all[2][200], buffer_of_stdout[BUFSIZ];
static double *table;
static int alive, made;

static void set_start(Model *m) {
    m->gain = 3, m->stage = 1, m->open = 1, m->u = 0.5;
    strcpy(m->text[0], "valve"), strcpy(m->text[1], "bar");
}

static void change_settings(void) {
    if (IS(seed_set)) srand(42);
    if (IS(stdout_buffered)) setvbuf(stdout, buffer_of_stdout, _IOFBF, sizeof buffer_of_stdout);
    if (IS(unusual)) {
        char *before = strdup(setlocale(LC_ALL, NULL));
        (void)rand();
        setlocale(LC_ALL, "C.UTF-8");
        setlocale(LC_ALL, before);
        free(before);
        FILE *log = fopen("valve.log", "w");
        if (log) fclose(log);
    }
}

static int begin(Model *m, const char *token, const char *resources) {
    (void)token;
    m->curve = read_resource(m->fmu.fmi == 2 && !IS(uri_not_decoded), resources, "curve.txt");
    change_settings();
    alive++, made++;
    if (!table) { table = (double *)malloc(sizeof *table); *table = 2; }
    return OK;
}

static void end(Model *m) {
    (void)m;
    if (--alive) return;
    free(table);
    table = NULL;
    if (IS(unusual)) unlink("valve.log");
}

__attribute__((destructor)) static void clean_up(void) {
    /* As if the library could only clean up after one instance. */
    if (IS(unload_after_two) && made > 1) abort();
}

static double flow(const Model *m) { return m->gain * m->stage * m->open + *table * m->u * (IS(factor_varies) ? 1 + m->level : 1); }

static bool place(Model *m, Kind kind, uint32_t vr, Place *to) {
    Fmu *f = &m->fmu;
    (void)kind;
    switch (vr) {
    case GAIN: return at_finite(to, &m->gain, FIXED, -DBL_MAX);
    case U: return at_finite(to, &m->u, INPUT, -DBL_MAX);
    case LEVEL: return calculated(f, to, m->level);
    case DER_LEVEL: case FLOW: return calculated(f, to, flow(m));
    case CURVE: return calculated(f, to, m->curve);
    /* The factor of u depends on the sign of u, which the standard allows for the kind "discrete". */
    case SHARE: return calculated(f, to, (m->u > 0 ? 2 : 3) * m->u * (IS(late) && f->steps > 3 ? m->open + 1 : 1));
    case TIME: return calculated(f, to, f->time);
    case STAGE: return at(to, INTEGER, &m->stage, INPUT), to->high = 5, true;
    case COUNT: return counted(f, to, INTEGER, f->steps);
    case OPEN: return at(to, BOOLEAN, &m->open, INPUT);
    case LABEL: case UNIT: {
        /* The standard allows buffers that the next call overwrites. */
        size_t index = vr - LABEL;
        char *buffer = IS(buffer_of_all) ? buffer_of_all[index] : m->buffer[IS(buffer_of_both) ? 0 : index];
        strcpy(buffer, m->text[index]);
        return at(to, TEXT, buffer, FIXED), to->count = sizeof m->text[0], true;
    }
    default: return false;
    }
}

static bool take(Model *m, uint32_t vr, const void *value) {
    if (vr != LABEL && vr != UNIT) return true;
    strcpy(m->text[vr - LABEL], (const char *)value);
    return false;
}

static int step(Model *m, double point, double size) {
    if (!(size < 1e6)) return reject(m, "no such step");
    m->level += size * flow(m);
    m->fmu.time = point + size;
    /* The model ends its simulation. */
    m->fmu.ended = IS(unusual) && m->fmu.time > 0.2 - 1e-9;
    if (m->fmu.ended && m->fmu.logging) LOG(&m->fmu, DISCARD, "logStatusError", "the level has been reached");
    return m->fmu.ended ? DISCARD : OK;
}

static void copy(Model *m, Model *copy, Copying why) {
    if (why == RESTORING && IS(text_shared_with_states)) memcpy(copy->text, m->text, sizeof m->text);
    if (why == SERIALIZING && IS(text_not_in_bytes)) strcpy(copy->text[0], "valve"), strcpy(copy->text[1], "bar");
}

static bool plausible(const Model *copy) { return memchr(copy->text[0], 0, 200) && memchr(copy->text[1], 0, 200); }

const Behaviour behaviour = {
    .token = "valve", .size = sizeof(Model), .saved = offsetof(Model, curve), .state = offsetof(Model, level), .begin = begin, .end = end,
    .start = set_start, .place = place, .take = take, .step = step, .copy = copy, .plausible = plausible,
};
