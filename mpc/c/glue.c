#include <stddef.h>

size_t @name@_sizes(int which)
{
  const size_t sizes[] = { sizeof(@name@_params), sizeof(@name@_state), sizeof(@name@_input),
                           sizeof(@name@_work) };
  return sizes[which];
}
