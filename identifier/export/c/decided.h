/* Where the equations of a driving car hold. */
bool @name@_drives(const @name@_input *in);

/* One step at rest, and with a sample that no car can be in. */
void @name@_elsewhere(const @name@_values *now, const @name@_input *in, @name@_values *next,
    @name@_output *out);

