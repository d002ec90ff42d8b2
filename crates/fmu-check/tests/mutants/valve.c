/* A valve with strings, discrete inputs and a file in its resources, as an FMU for Co-Simulation of FMI 2.0 or, with -DFMI=3, of
   FMI 3.0. It is correct, unless the environment variable VALVE_FAULT names faults, with + between them. With the name "unusual", the
   valve is still correct, but does what a careless check would report. The headers of FMI are not used, so that the test FMU shares
   nothing with the tested code. */
#define _GNU_SOURCE
#include <ctype.h>
#include <locale.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static char faults[500] = "+none+";
#define IS(name) (strstr(faults, "+" #name "+") != NULL)

__attribute__((constructor)) static void choose(void) {
    if (getenv("VALVE_FAULT")) snprintf(faults, sizeof faults, "+%s+", getenv("VALVE_FAULT"));
}

#if FMI == 3
#define EXPORT(name) int fmi3##name
typedef bool Flag;
#define SIZES , size_t nvalues
#else
#define EXPORT(name) int fmi2##name
typedef int Flag;
#define SIZES
#endif

enum { GAIN = 1, LABEL, UNIT, OPEN, STAGE, U, LEVEL, DER_LEVEL, FLOW, COUNT, CURVE, SHARE, TIME };
enum { MADE = 1, INITIALIZING = 2, STEPPING = 4, ENDED = 8 };
enum { OK, DISCARD = 2, ERROR = 3 };

typedef struct {
    double time, gain, u, level, curve;
    int open, stage, steps, mode;
    char *text[2];
} State;

typedef struct {
    State s;
    char buffer[2][200];
} Valve;

static char buffer_of_all[2][200], buffer_of_stdout[BUFSIZ];
static double *table;
static int alive, made;

static char *copy(const char *text) { return text ? strdup(text) : NULL; }

static void own(State *to, const State *from) {
    *to = *from;
    to->text[0] = copy(from->text[0]);
    to->text[1] = copy(from->text[1]);
}

static void start(State *s) {
    free(s->text[0]);
    free(s->text[1]);
    memset(s, 0, sizeof *s);
    s->gain = 3; s->stage = 1; s->open = 1; s->u = 0.5; s->mode = MADE;
    s->text[0] = copy("valve"); s->text[1] = copy("bar");
}

/* Returns the number in the file curve.txt of the resources. */
static double read_curve(const char *location) {
    char path[5000] = "", *to = path;
    const char *at = location ? location : "";
    bool decodes = FMI == 2 && !IS(uri_not_decoded);
    if (strncmp(at, "file://", 7) == 0) at += 7;
    for (; *at && to < path + 4900; at++) {
        if (decodes && *at == '%' && isxdigit((unsigned char)at[1]) && isxdigit((unsigned char)at[2])) {
            char digits[3] = {at[1], at[2], 0};
            *to++ = (char)strtol(digits, NULL, 16);
            at += 2;
        } else *to++ = *at;
    }
    strcpy(to, FMI == 2 ? "/curve.txt" : "curve.txt");
    double number = 0;
    FILE *file = fopen(path, "r");
    if (file) { if (fscanf(file, "%lf", &number) != 1) number = 0; fclose(file); }
    return number;
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

static Valve *make(const char *token, const char *location) {
    if (!token || strcmp(token, "valve")) return NULL;
    Valve *v = calloc(1, sizeof *v);
    start(&v->s);
    v->s.curve = read_curve(location);
    change_settings();
    alive++;
    made++;
    if (!table) { table = malloc(sizeof *table); *table = 2; }
    return v;
}

static void release(Valve *v) {
    if (!v) return;
    free(v->s.text[0]);
    free(v->s.text[1]);
    free(v);
    alive--;
    if (!alive) { free(table); table = NULL; }
    if (IS(unusual) && !alive) unlink("valve.log");
}

__attribute__((destructor)) static void unloaded(void) {
    /* As if the library could only clean up after one instance. */
    if (IS(unload_after_two) && made > 1) abort();
}

#define ALLOW(modes) Valve *v = c; if (!v || !(v->s.mode & (modes))) return ERROR;

static double flow(const State *s) {
    double share = IS(factor_varies) ? 1 + s->level : 1;
    return s->gain * s->stage * s->open + *table * s->u * share;
}

static double get(const State *s, uint32_t vr) {
    switch (vr) {
    case GAIN: return s->gain;
    case U: return s->u;
    case LEVEL: return s->level;
    case DER_LEVEL: case FLOW: return flow(s);
    case CURVE: return s->curve;
    /* The factor of u depends on the sign of u, which the standard allows for the kind "discrete". */
    case SHARE: return (s->u > 0 ? 2 : 3) * s->u * (IS(late) && s->steps > 3 ? s->open + 1 : 1);
    case TIME: return s->time;
    default: return NAN;
    }
}

static int get_reals(void *c, const uint32_t *vr, size_t n, double *value) {
    ALLOW(15)
    for (size_t i = 0; i < n; i++) {
        if (isnan(get(&v->s, vr[i]))) return ERROR;
        value[i] = get(&v->s, vr[i]);
    }
    return OK;
}
static int set_reals(void *c, const uint32_t *vr, size_t n, const double *value) {
    ALLOW(MADE | INITIALIZING | STEPPING)
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(value[i]) || (vr[i] != U && !(vr[i] == GAIN && v->s.mode != STEPPING))) return ERROR;
        *(vr[i] == U ? &v->s.u : &v->s.gain) = value[i];
    }
    return OK;
}
static int get_integers(void *c, const uint32_t *vr, size_t n, int32_t *value) {
    ALLOW(15)
    for (size_t i = 0; i < n; i++) { if (vr[i] != STAGE && vr[i] != COUNT) return ERROR; value[i] = vr[i] == STAGE ? v->s.stage : v->s.steps; }
    return OK;
}
static int set_integers(void *c, const uint32_t *vr, size_t n, const int32_t *value) {
    ALLOW(MADE | INITIALIZING | STEPPING)
    for (size_t i = 0; i < n; i++) { if (vr[i] != STAGE || value[i] < 0 || value[i] > 5) return ERROR; v->s.stage = value[i]; }
    return OK;
}
static int get_booleans(void *c, const uint32_t *vr, size_t n, Flag *value) {
    ALLOW(15)
    for (size_t i = 0; i < n; i++) { if (vr[i] != OPEN) return ERROR; value[i] = v->s.open; }
    return OK;
}
static int set_booleans(void *c, const uint32_t *vr, size_t n, const Flag *value) {
    ALLOW(MADE | INITIALIZING | STEPPING)
    for (size_t i = 0; i < n; i++) { if (vr[i] != OPEN) return ERROR; v->s.open = value[i]; }
    return OK;
}

/* The standard allows buffers that the next call overwrites. */
static int get_strings(void *c, const uint32_t *vr, size_t n, const char **value) {
    ALLOW(15)
    for (size_t i = 0; i < n; i++) {
        if (vr[i] != LABEL && vr[i] != UNIT) return ERROR;
        size_t at = vr[i] - LABEL;
        char *buffer = IS(buffer_of_all) ? buffer_of_all[at] : v->buffer[IS(buffer_of_both) ? 0 : at];
        snprintf(buffer, sizeof v->buffer[0], "%s", v->s.text[at]);
        value[i] = buffer;
    }
    return OK;
}
static int set_strings(void *c, const uint32_t *vr, size_t n, const char *const *value) {
    ALLOW(MADE | INITIALIZING)
    for (size_t i = 0; i < n; i++) {
        if ((vr[i] != LABEL && vr[i] != UNIT) || strlen(value[i]) > 190) return ERROR;
        size_t at = vr[i] - LABEL;
        if (IS(text_shared_with_states)) { if (strlen(v->s.text[at]) < strlen(value[i])) v->s.text[at] = malloc(200); strcpy(v->s.text[at], value[i]); continue; }
        free(v->s.text[at]);
        v->s.text[at] = copy(value[i]);
    }
    return OK;
}

static int step(void *c, double point, double size) {
    ALLOW(STEPPING)
    if (!isfinite(point) || !(size > 0) || !(size < 1e6) || fabs(point - v->s.time) > 1e-9 * (1 + fabs(point))) return ERROR;
    v->s.level += size * flow(&v->s);
    v->s.time = point + size;
    v->s.steps++;
    /* The model ends its simulation. */
    if (IS(unusual) && v->s.time > 0.2 - 1e-9) return DISCARD;
    return OK;
}

#if FMI == 3
#define FMU_STATE(verb) EXPORT(verb##FMUState)
#define DESERIALIZE EXPORT(DeserializeFMUState)
#define SIZE EXPORT(SerializedFMUStateSize)
#else
#define FMU_STATE(verb) EXPORT(verb##FMUstate)
#define DESERIALIZE EXPORT(DeSerializeFMUstate)
#define SIZE EXPORT(SerializedFMUstateSize)
#endif
FMU_STATE(Get)(void *c, void **state) {
    ALLOW(15)
    State *saved = *state ? *state : calloc(1, sizeof *saved);
    if (IS(text_shared_with_states)) *saved = v->s;
    else { if (*state) { free(saved->text[0]); free(saved->text[1]); } own(saved, &v->s); }
    *state = saved;
    return OK;
}
FMU_STATE(Set)(void *c, void *state) {
    ALLOW(15)
    State *saved = state;
    if (!saved) return ERROR;
    if (IS(text_shared_with_states)) { v->s = *saved; return OK; }
    State before = v->s;
    own(&v->s, saved);
    free(before.text[0]);
    free(before.text[1]);
    return OK;
}
FMU_STATE(Free)(void *c, void **state) {
    ALLOW(15)
    State *saved = state ? *state : NULL;
    if (!saved) return OK;
    if (!IS(text_shared_with_states)) { free(saved->text[0]); free(saved->text[1]); }
    free(saved);
    *state = NULL;
    return OK;
}
SIZE(void *c, void *state, size_t *size) { ALLOW(15) (void)state; *size = sizeof(State) + 400; return OK; }
FMU_STATE(Serialize)(void *c, void *state, char *bytes, size_t size) {
    ALLOW(15)
    State *saved = state, plain;
    if (!saved || size < sizeof plain + 400) return ERROR;
    plain = *saved;
    plain.text[0] = plain.text[1] = NULL;
    memset(bytes, 0, size);
    memcpy(bytes, &plain, sizeof plain);
    if (!IS(text_not_in_bytes)) for (int i = 0; i < 2; i++) strcpy(bytes + sizeof plain + 200 * i, saved->text[i]);
    return OK;
}
DESERIALIZE(void *c, const char *bytes, size_t size, void **state) {
    ALLOW(15)
    State *saved;
    if (size != sizeof *saved + 400) return ERROR;
    saved = malloc(sizeof *saved);
    memcpy(saved, bytes, sizeof *saved);
    for (int i = 0; i < 2; i++) {
        const char *text = bytes + sizeof *saved + 200 * i;
        saved->text[i] = copy(IS(text_not_in_bytes) ? i ? "bar" : "valve" : text);
    }
    *state = saved;
    return OK;
}

EXPORT(SetDebugLogging)(void *c, Flag on, size_t n, const char *const *categories) { ALLOW(15) (void)on; (void)n; (void)categories; return OK; }
EXPORT(ExitInitializationMode)(void *c) { ALLOW(INITIALIZING) v->s.mode = STEPPING; return OK; }
EXPORT(Terminate)(void *c) { ALLOW(STEPPING) v->s.mode = ENDED; return OK; }
EXPORT(Reset)(void *c) { ALLOW(15) double curve = v->s.curve; start(&v->s); v->s.curve = curve; return OK; }
#define ACCESS(name, type, get, set)                                                                                   \
    EXPORT(Get##name)(void *c, const uint32_t *vr, size_t n, type *value SIZES) { return get(c, vr, n, value); }       \
    EXPORT(Set##name)(void *c, const uint32_t *vr, size_t n, const type *value SIZES) { return set(c, vr, n, value); }
typedef const char *Text;
ACCESS(String, Text, get_strings, set_strings)
ACCESS(Boolean, Flag, get_booleans, set_booleans)
#if FMI == 3
const char *fmi3GetVersion(void) { return "3.0"; }
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging, bool events,
                                  bool early, const uint32_t *vr, size_t n, void *environment, void *log, void *intermediate) {
    (void)name; (void)visible; (void)logging; (void)events; (void)early; (void)vr; (void)n; (void)environment; (void)log; (void)intermediate;
    return make(token, resources);
}
void fmi3FreeInstance(void *c) { release(c); }
EXPORT(EnterInitializationMode)(void *c, bool defined, double tolerance, double from, bool stops, double stop) {
    ALLOW(MADE)
    (void)defined; (void)tolerance; (void)stops; (void)stop;
    v->s.time = from;
    v->s.mode = INITIALIZING;
    return OK;
}
ACCESS(Float64, double, get_reals, set_reals)
ACCESS(Int32, int32_t, get_integers, set_integers)
EXPORT(DoStep)(void *c, double point, double size, bool no_set, bool *event, bool *terminate, bool *early, double *last) {
    (void)no_set;
    *event = *terminate = *early = false;
    *last = point + size;
    return step(c, point, size);
}
#else
const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
void *fmi2Instantiate(const char *name, int type, const char *token, const char *resources, const void *callbacks, int visible, int logging) {
    (void)name; (void)type; (void)callbacks; (void)visible; (void)logging;
    return make(token, resources);
}
void fmi2FreeInstance(void *c) { release(c); }
EXPORT(SetupExperiment)(void *c, int defined, double tolerance, double from, int stops, double stop) {
    ALLOW(MADE)
    (void)defined; (void)tolerance; (void)stops; (void)stop;
    v->s.time = from;
    return OK;
}
EXPORT(EnterInitializationMode)(void *c) { ALLOW(MADE) v->s.mode = INITIALIZING; return OK; }
ACCESS(Real, double, get_reals, set_reals)
ACCESS(Integer, int32_t, get_integers, set_integers)
EXPORT(DoStep)(void *c, double point, double size, int no_set) { (void)no_set; return step(c, point, size); }
EXPORT(GetRealStatus)(void *c, int kind, double *value) {
    ALLOW(STEPPING | ENDED)
    if (kind != 2) return DISCARD;
    *value = v->s.time - (IS(last_time_of_begin) ? 0.01 : 0);
    return OK;
}
EXPORT(GetBooleanStatus)(void *c, int kind, int *value) {
    ALLOW(STEPPING | ENDED)
    if (kind != 3) return DISCARD;
    *value = IS(unusual) && v->s.time > 0.2 - 1e-9;
    return OK;
}
EXPORT(GetStatus)(void *c, int kind, int *value) { ALLOW(STEPPING | ENDED) (void)kind; (void)value; return DISCARD; }
EXPORT(GetIntegerStatus)(void *c, int kind, int *value) { ALLOW(STEPPING | ENDED) (void)kind; (void)value; return DISCARD; }
EXPORT(GetStringStatus)(void *c, int kind, const char **value) { ALLOW(STEPPING | ENDED) (void)kind; (void)value; return DISCARD; }
#endif
