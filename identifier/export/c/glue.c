#include <string.h>

typedef struct { @name@_state state; @name@_params params; } @name@_instance;

size_t @name@_instance_size(void) { return sizeof(@name@_instance); }
size_t @name@_state_size(void) { return sizeof(@name@_state); }
void @name@_instance_init(@name@_instance *it)
{
  memset(it, 0, sizeof *it);
  @name@_default_params(&it->params);
  @name@_init(&it->state);
}
void @name@_instance_reset(@name@_instance *it) { @name@_reset(&it->state); }
void @name@_instance_run(@name@_instance *it, long n, const double *samples, double *output,
                         int *status)
{
  const size_t size = sizeof(@name@_output) / sizeof(@name@_real);
  @name@_real told[sizeof(@name@_output) / sizeof(@name@_real)];
  long k;
  size_t i;
  for (k = 0; k < n; ++k) {
    const double *s = samples + 5 * k;
    const @name@_input input = { (@name@_real)s[0], (@name@_real)s[1], (@name@_real)s[2],
                                  (@name@_real)s[3], (@name@_real)s[4] };
    status[k] = (int)@name@_step(&it->state, &it->params, &input);
    memcpy(told, &it->state.output, sizeof told);
    for (i = 0; i < size; ++i) output[k * (long)size + (long)i] = (double)told[i];
  }
}
unsigned @name@_instance_faults(const @name@_instance *it) { return it->state.faults; }
