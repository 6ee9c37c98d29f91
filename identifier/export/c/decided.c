bool @name@_drives(const @name@_input *in)
{
@drives@}

void @name@_elsewhere(const @name@_values *now, const @name@_input *in, @name@_values *next,
    @name@_output *out)
{
@elsewhere@}

