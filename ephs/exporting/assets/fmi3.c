/* A unit of FMI 3.0 for co-simulation around an exported mechanism; MODEL is the beginning of its functions' names.
 * Value references: 0 is the time, then inputs, parameters and outputs, in the order of the header. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define JOIN_(a, b) a##_##b
#define JOIN(a, b) JOIN_(a, b)
#define CALL(f) JOIN(MODEL, f)
#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
int _fltused = 0; /* wanted by object code of LLVM for Windows */
#else
#define EXPORT __attribute__((visibility("default")))
#endif

void CALL(start)(void *memory);
void CALL(parameters)(void *memory, const double *values);
void CALL(inputs)(void *memory, const double *values);
int64_t CALL(advance)(void *memory, double until);
int64_t CALL(outputs)(void *memory, double *values);

typedef int Status;
enum { OK, WARNING, DISCARD, ERROR, FATAL };
typedef void (*Log)(void *environment, Status status, const char *category, const char *message);

typedef struct {
  double origin, time;
  bool running, begun, read;
  double in[INPUTS + 1], given[PARAMETERS + 1], out[OUTPUTS + 1];
  double memory[BYTES / 8 + 1];
} State;

typedef struct {
  void *environment;
  Log log;
  State state;
} Unit;

static const double input_starts[] = {INPUT_STARTS 0.0};
static const double parameter_starts[] = {PARAMETER_STARTS 0.0};

static Status fail(Unit *unit, const char *what, int64_t status) {
  char text[200];
  snprintf(text, sizeof text, "%s: status %d at %.17g s", what, (int)status, unit->state.time);
  if (unit->log) unit->log(unit->environment, ERROR, "logStatusError", text);
  return ERROR;
}

static void restart(Unit *unit) {
  State *s = &unit->state;
  memset(s, 0, sizeof *s);
  memcpy(s->in, input_starts, sizeof(double) * INPUTS);
  memcpy(s->given, parameter_starts, sizeof(double) * PARAMETERS);
}

/* The mechanism at its start with the parameters as they are now. */
static void begin(Unit *unit) {
  State *s = &unit->state;
  CALL(start)(s->memory);
  if (PARAMETERS) CALL(parameters)(s->memory, s->given);
  s->begun = true;
  s->read = false;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT Status fmi3SetDebugLogging(void *unit, bool on, size_t count, const char *const *categories) { return OK; }

EXPORT void *fmi3InstantiateCoSimulation(
    const char *name, const char *token, const char *resources, bool visible, bool logging, bool events, bool early,
    const uint32_t *intermediate, size_t count, void *environment, Log log, void *update) {
  Unit *unit = token && !strcmp(token, TOKEN) ? calloc(1, sizeof *unit) : NULL;
  if (!unit) {
    if (log) log(environment, ERROR, "logStatusError", "the instantiation token is another one, or memory is short");
    return NULL;
  }
  unit->environment = environment;
  unit->log = log;
  restart(unit);
  return unit;
}

EXPORT void fmi3FreeInstance(void *unit) { free(unit); }

EXPORT Status fmi3EnterInitializationMode(
    void *instance, bool tolerance_defined, double tolerance, double start, bool stop_defined, double stop) {
  Unit *unit = instance;
  unit->state.origin = unit->state.time = start;
  begin(unit);
  return OK;
}

EXPORT Status fmi3ExitInitializationMode(void *instance) {
  begin(instance);
  ((Unit *)instance)->state.running = true;
  return OK;
}

EXPORT Status fmi3Terminate(void *unit) { return OK; }

EXPORT Status fmi3Reset(void *instance) {
  restart(instance);
  return OK;
}

EXPORT Status fmi3DoStep(
    void *instance, double point, double length, bool no_state_before, bool *event, bool *terminate, bool *early,
    double *last) {
  Unit *unit = instance;
  State *s = &unit->state;
  *event = *terminate = *early = false;
  *last = s->time;
  if (!s->running) return fail(unit, "fmi3DoStep before initialization", 0);
  if (!(length >= 0.0)) return fail(unit, "fmi3DoStep backwards", 0);
  /* masters add up their steps: times agree to rounding */
  double apart = point - s->time, scale = (point < 0.0 ? -point : point) + length;
  if (!(apart <= 1e-9 * scale && -apart <= 1e-9 * scale))
    return fail(unit, "fmi3DoStep from a point that is not the time reached", 0);
  if (INPUTS) CALL(inputs)(s->memory, s->in);
  int64_t status = CALL(advance)(s->memory, point + length - s->origin);
  if (status) return fail(unit, "no step", status);
  s->time = *last = point + length;
  s->read = false;
  return OK;
}

EXPORT Status fmi3GetFloat64(void *instance, const uint32_t *references, size_t count, double *values, size_t n) {
  Unit *unit = instance;
  State *s = &unit->state;
  for (size_t k = 0; k < count; k++) {
    uint32_t place = references[k];
    if (place == 0) values[k] = s->time;
    else if (place <= INPUTS) values[k] = s->in[place - 1];
    else if (place <= INPUTS + PARAMETERS) values[k] = s->given[place - 1 - INPUTS];
    else if (place <= INPUTS + PARAMETERS + OUTPUTS) {
      if (!s->begun) begin(unit);
      if (!s->read) {
        int64_t status = CALL(outputs)(s->memory, s->out);
        if (status) return fail(unit, "no outputs", status);
        s->read = true;
      }
      values[k] = s->out[place - 1 - INPUTS - PARAMETERS];
    } else return fail(unit, "no such value reference", place);
  }
  return OK;
}

EXPORT Status fmi3SetFloat64(void *instance, const uint32_t *references, size_t count, const double *values, size_t n) {
  Unit *unit = instance;
  for (size_t k = 0; k < count; k++) {
    uint32_t place = references[k];
    if (place >= 1 && place <= INPUTS) unit->state.in[place - 1] = values[k];
    else if (place > INPUTS && place <= INPUTS + PARAMETERS) {
      if (unit->state.running) return fail(unit, "parameters are fixed after initialization", place);
      unit->state.given[place - 1 - INPUTS] = values[k];
      unit->state.begun = unit->state.read = false; /* outputs are those of the changed model */
    } else return fail(unit, "no input or parameter has this value reference", place);
  }
  return OK;
}

EXPORT Status fmi3GetFMUState(void *instance, void **state) {
  if (!*state) *state = malloc(sizeof(State));
  if (!*state) return ERROR;
  memcpy(*state, &((Unit *)instance)->state, sizeof(State));
  return OK;
}

EXPORT Status fmi3FreeFMUState(void *instance, void **state) {
  free(*state);
  *state = NULL;
  return OK;
}

/* Functions lie at other addresses in another process: they are written anew over the numbers of the state. */
static void relocate(State *s) {
  static const size_t places[] = {FUNCTIONS BYTES};
  double *fresh = malloc(sizeof s->memory);
  if (!fresh) return;
  CALL(start)(fresh);
  for (size_t k = 0; k + 1 < sizeof places / sizeof *places; k++)
    memcpy((char *)s->memory + places[k], (char *)fresh + places[k], 8);
  free(fresh);
}

EXPORT Status fmi3SetFMUState(void *instance, void *state) {
  memcpy(&((Unit *)instance)->state, state, sizeof(State));
  relocate(&((Unit *)instance)->state);
  return OK;
}

EXPORT Status fmi3SerializedFMUStateSize(void *instance, void *state, size_t *size) {
  *size = sizeof(State);
  return OK;
}

EXPORT Status fmi3SerializeFMUState(void *instance, void *state, uint8_t *bytes, size_t size) {
  if (size < sizeof(State)) return ERROR;
  memcpy(bytes, state, sizeof(State));
  return OK;
}

EXPORT Status fmi3DeserializeFMUState(void *instance, const uint8_t *bytes, size_t size, void **state) {
  if (size != sizeof(State)) return ERROR;
  if (!*state) *state = malloc(sizeof(State));
  if (!*state) return ERROR;
  memcpy(*state, bytes, sizeof(State));
  return OK;
}

/* What a mechanism does not have: other types, other interfaces, clocks, derivatives. */
#define ABSENT(name) \
  EXPORT Status name(void) { return ERROR; }
#define NOTHING(name) \
  EXPORT void *name(void) { return NULL; }
NOTHING(fmi3InstantiateModelExchange)
NOTHING(fmi3InstantiateScheduledExecution)
ABSENT(fmi3EnterEventMode)
ABSENT(fmi3EnterStepMode)
ABSENT(fmi3EnterConfigurationMode)
ABSENT(fmi3ExitConfigurationMode)
ABSENT(fmi3GetFloat32)
ABSENT(fmi3GetInt8)
ABSENT(fmi3GetUInt8)
ABSENT(fmi3GetInt16)
ABSENT(fmi3GetUInt16)
ABSENT(fmi3GetInt32)
ABSENT(fmi3GetUInt32)
ABSENT(fmi3GetInt64)
ABSENT(fmi3GetUInt64)
ABSENT(fmi3GetBoolean)
ABSENT(fmi3GetString)
ABSENT(fmi3GetBinary)
ABSENT(fmi3GetClock)
ABSENT(fmi3SetFloat32)
ABSENT(fmi3SetInt8)
ABSENT(fmi3SetUInt8)
ABSENT(fmi3SetInt16)
ABSENT(fmi3SetUInt16)
ABSENT(fmi3SetInt32)
ABSENT(fmi3SetUInt32)
ABSENT(fmi3SetInt64)
ABSENT(fmi3SetUInt64)
ABSENT(fmi3SetBoolean)
ABSENT(fmi3SetString)
ABSENT(fmi3SetBinary)
ABSENT(fmi3SetClock)
ABSENT(fmi3GetNumberOfVariableDependencies)
ABSENT(fmi3GetVariableDependencies)
ABSENT(fmi3GetDirectionalDerivative)
ABSENT(fmi3GetAdjointDerivative)
ABSENT(fmi3GetOutputDerivatives)
ABSENT(fmi3GetIntervalDecimal)
ABSENT(fmi3GetIntervalFraction)
ABSENT(fmi3GetShiftDecimal)
ABSENT(fmi3GetShiftFraction)
ABSENT(fmi3SetIntervalDecimal)
ABSENT(fmi3SetIntervalFraction)
ABSENT(fmi3SetShiftDecimal)
ABSENT(fmi3SetShiftFraction)
ABSENT(fmi3EvaluateDiscreteStates)
ABSENT(fmi3UpdateDiscreteStates)
ABSENT(fmi3EnterContinuousTimeMode)
ABSENT(fmi3CompletedIntegratorStep)
ABSENT(fmi3SetTime)
ABSENT(fmi3SetContinuousStates)
ABSENT(fmi3GetContinuousStateDerivatives)
ABSENT(fmi3GetEventIndicators)
ABSENT(fmi3GetContinuousStates)
ABSENT(fmi3GetNominalsOfContinuousStates)
ABSENT(fmi3GetNumberOfEventIndicators)
ABSENT(fmi3GetNumberOfContinuousStates)
ABSENT(fmi3ActivateModelPartition)
