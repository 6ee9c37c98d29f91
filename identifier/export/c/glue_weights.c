void @name@_instance_adapt(@name@_instance *it, int adapts)
{
  @name@_set_adaptation(&it->state, adapts != 0);
}
void @name@_instance_weights(const @name@_instance *it, double *flat)
{
  @name@_weights weights;
  @name@_real number[sizeof weights / sizeof(@name@_real)];
  size_t i;
  @name@_get_weights(&it->state, &weights);
  memcpy(number, &weights, sizeof weights);
  for (i = 0; i < sizeof number / sizeof number[0]; ++i) flat[i] = (double)number[i];
}
int @name@_instance_take(@name@_instance *it, const double *flat)
{
  @name@_weights weights;
  @name@_real number[sizeof weights / sizeof(@name@_real)];
  size_t i;
  for (i = 0; i < sizeof number / sizeof number[0]; ++i) number[i] = (@name@_real)flat[i];
  memcpy(&weights, number, sizeof weights);
  return (int)@name@_set_weights(&it->state, &weights);
}
