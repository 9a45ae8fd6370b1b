/* A unit of FMI 2.0: a spring whose end moves at a given speed. References: 0 speed, 1 force, 2 impulse, 3 stiffness. */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
  double speed, place, impulse, stiffness;
} Spring;

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *place, void *calls, int v, int l) {
  Spring *s = calloc(1, sizeof *s);
  s->stiffness = 100.0;
  return s;
}
void fmi2FreeInstance(void *s) { free(s); }
int fmi2SetupExperiment(void *s, int t, double tolerance, double start, int e, double end) { return 0; }
int fmi2EnterInitializationMode(void *s) { return 0; }
int fmi2ExitInitializationMode(void *s) { return 0; }
int fmi2SetReal(Spring *s, const unsigned *refs, size_t n, const double *values) {
  for (size_t i = 0; i < n; i++) {
    if (refs[i] == 0) s->speed = values[i];
    else if (refs[i] == 3) s->stiffness = values[i];
    else return 3;
  }
  return 0;
}
int fmi2GetReal(Spring *s, const unsigned *refs, size_t n, double *values) {
  double of[] = {s->speed, s->stiffness * s->place, s->impulse, s->stiffness};
  for (size_t i = 0; i < n; i++) values[i] = of[refs[i]];
  return 0;
}
int fmi2DoStep(Spring *s, double t, double h, int keep) {
  if (s->place > 1e3) return 3;
  s->impulse += s->stiffness * h * (s->place + 0.5 * h * s->speed);
  s->place += h * s->speed;
  return 0;
}
int fmi2GetFMUstate(Spring *s, void **state) {
  *state = malloc(sizeof *s);
  memcpy(*state, s, sizeof *s);
  return 0;
}
int fmi2SetFMUstate(Spring *s, void *state) { memcpy(s, state, sizeof *s); return 0; }
int fmi2FreeFMUstate(Spring *s, void **state) { free(*state); *state = NULL; return 0; }
int fmi2SerializedFMUstateSize(Spring *s, void *state, size_t *size) { *size = sizeof *s; return 0; }
int fmi2SerializeFMUstate(Spring *s, void *state, char *bytes, size_t n) { memcpy(bytes, state, n); return 0; }
int fmi2DeSerializeFMUstate(Spring *s, const char *bytes, size_t n, void **state) {
  *state = malloc(n);
  memcpy(*state, bytes, n);
  return 0;
}

#define NOT_THERE(name) \
  int name(void) { return 3; }
NOT_THERE(fmi2SetDebugLogging)
NOT_THERE(fmi2Terminate)
NOT_THERE(fmi2Reset)
NOT_THERE(fmi2GetInteger)
NOT_THERE(fmi2GetBoolean)
NOT_THERE(fmi2GetString)
NOT_THERE(fmi2SetInteger)
NOT_THERE(fmi2SetBoolean)
NOT_THERE(fmi2SetString)
NOT_THERE(fmi2GetDirectionalDerivative)
NOT_THERE(fmi2SetRealInputDerivatives)
NOT_THERE(fmi2GetRealOutputDerivatives)
NOT_THERE(fmi2CancelStep)
NOT_THERE(fmi2GetStatus)
NOT_THERE(fmi2GetRealStatus)
NOT_THERE(fmi2GetIntegerStatus)
NOT_THERE(fmi2GetBooleanStatus)
NOT_THERE(fmi2GetStringStatus)
