/* What Python asks of the tracker, in one translation unit with it: see realtime/instance.py. */
#include <stddef.h>

#include "tireid_mpc.h"

size_t tireid_mpc_sizes(int which);

size_t tireid_mpc_sizes(int which)
{
    const size_t sizes[] = { sizeof(tireid_mpc_params), sizeof(tireid_mpc_state),
        sizeof(tireid_mpc_input), sizeof(tireid_mpc_work) };
    return sizes[which];
}
