/* A model, read from tables in the order in which step_tables.py writes them, and the memory of a flight.
 *
 * Before this text stands step_driver.c.
 */

static struct sparse sparse(struct reader *from)
{
    struct sparse of;
    of.rows = from->tables[0] - 1;
    of.start = table(from);
    of.column = table(from);
    of.source = table(from);
    return of;
}

static struct curvature curvature(struct reader *from)
{
    struct curvature of;
    of.variable = table(from);
    of.hessian = sparse(from);
    of.dependent = sparse(from);
    return of;
}

static struct model read_model(struct reader *from)
{
    struct model of, *model = &of;
    of.size = table(from);
    of.column_of = table(from);
    of.acting_state = table(from);
    of.jacobian_source = table(from);
    of.hessian_source = table(from);
    of.A = numbers(from, STAGES * STAGES);
    of.B = numbers(from, STAGES);
    of.rates_jacobian = sparse(from);
    of.rates_hessian = curvature(from);
    of.projection_jacobian = sparse(from);
    of.projection_hessian = curvature(from);
    of.rates = function(from);
    of.rates_linear = function(from);
    of.rates_curved = function(from);
    of.projection_linear = function(from);
    of.projection_curved = function(from);
    return of;
}

static struct flight make_flight(const struct model *model, struct reader *from)
{
    struct flight of = {.g = all(0.0)};
    const integer stages = STEPS * STAGES;
    of.y = room(from, NY);
    of.x = room(from, NX);
    of.dx = room(from, NX * PADDED);
    of.z = room(from, stages * NZ);
    of.K = room(from, stages * NX);
    of.jacobian = room(from, stages * RATES_NONZEROS);
    of.S = room(from, stages * NZ * PADDED);
    of.V = room(from, NX);
    of.dK = room(from, STAGES * NX * PADDED);
    of.nonzero = room(from, MOST_NONZEROS);
    of.rows = room(from, 2 * NZ * PADDED);
    of.lam = room(from, NX);
    of.gradient = room(from, NY);
    of.w = room(from, PADDED);
    of.zbar = room(from, STAGES * NZ);
    of.k = room(from, NX);
    of.weighted = room(from, NX);
    of.hessian = room(from, COLUMNS * PADDED);
    return of;
}
