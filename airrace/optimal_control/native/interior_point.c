/* The steps of a primal-dual interior point method on a program of stages, see interior_point.h.
 *
 * The step from (w, y, e, s, z) solves, with residuals of stationarity, gaps, equalities and slacks in that order,
 *
 *     H dw + F' dy + C' de - B' dz = -r_w    F dw = -r_y    C dw - de / weight = -r_e    B dw - ds = -r_s
 *     s dz + z ds = products
 *
 * where rows of B have the sign of their bound. Slacks and their multipliers are eliminated, which weighs a bound by z/s;
 * equalities are weighed likewise, by a number so large that what is left of them the next step sees to. */
#include "interior_point.h"

#include <math.h>
#include <string.h>

#include "riccati.h"

typedef const struct interior_program *Program;

/* where the parts of a point begin */
static inline int y_of(Program p) { return p->unknowns; }
static inline int e_of(Program p) { return y_of(p) + p->gaps; }
static inline int s_of(Program p) { return e_of(p) + p->equalities; }
static inline int z_of(Program p) { return s_of(p) + p->inequalities; }
static inline int size_of(Program p) { return z_of(p) + p->inequalities; }

static inline double larger(double a, double b) { return b > a || b != b ? b : a; } /* NaN if either is */

static double largest(int n, const double *values)
{
    double result = 0.0;
    for (int i = 0; i < n; i++) result = larger(result, fabs(values[i]));
    return result;
}

static double sum_of_sizes(int n, const double *values)
{
    double sum = 0.0;
    for (int i = 0; i < n; i++) sum += fabs(values[i]);
    return sum;
}

/* multipliers of (rows, unknowns), positive where an upper bound is pressed on */
static void bound_multipliers(Program p, const double *point, double *multipliers)
{
    const double *e = point + e_of(p), *z = point + z_of(p);
    memset(multipliers, 0, sizeof(double) * (p->rows + p->unknowns));
    for (int i = 0; i < p->inequalities; i++) multipliers[p->inequality[i]] -= p->sign[i] * z[i];
    for (int i = 0; i < p->equalities; i++) multipliers[p->equality[i]] += e[i];
}

void interior_multipliers(Program p, const double *point, double *multipliers)
{
    bound_multipliers(p, point, p->values);
    memset(multipliers, 0, sizeof(double) * p->constraints);
    for (int i = 0; i < p->gaps; i++) multipliers[p->gap_index[i]] = point[y_of(p) + i];
    for (int i = 0; i < p->rows; i++) multipliers[p->row_index[i]] = p->values[i];
}

void interior_residuals(
    Program p, const double *point, const double *gradient, const double *constraints, double *residuals,
    double *measures)
{
    const double *y = point + y_of(p), *s = point + s_of(p), *z = point + z_of(p);
    double *gaps = residuals + y_of(p), *equalities = residuals + e_of(p), *slacks = residuals + s_of(p);
    bound_multipliers(p, point, p->values);
    const double constraint_multipliers = sum_of_sizes(p->gaps, y) + sum_of_sizes(p->rows, p->values);
    measures[CONSTRAINT_MULTIPLIER] = p->constraints ? constraint_multipliers / p->constraints : 0.0;
    measures[BOUND_MULTIPLIER] = sum_of_sizes(p->unknowns, p->values + p->rows) / p->unknowns;
    for (int i = 0; i < p->unknowns; i++) residuals[i] = gradient[i] + p->values[p->rows + i];
    for (int i = 0; i < p->gaps; i++) gaps[i] = constraints[p->gap_index[i]] - p->jump[i];
    for (int i = 0; i < p->rows; i++) p->values[i] = constraints[p->row_index[i]];
    memcpy(p->values + p->rows, point, sizeof(double) * p->unknowns);
    for (int i = 0; i < p->equalities; i++) equalities[i] = p->values[p->equality[i]] - p->target[i];
    double complementarity = 0.0, most = 0.0, least = HUGE_VAL, products = 0.0;
    for (int i = 0; i < p->inequalities; i++) {
        const double room = p->sign[i] * (p->values[p->inequality[i]] - p->bound[i]);
        slacks[i] = room - s[i];
        complementarity = larger(complementarity, fabs(room * z[i]));
        const double product = s[i] * z[i];
        most = larger(most, product);
        least = product < least ? product : least;
        products += product;
    }
    const int primal = z_of(p) - y_of(p);
    measures[PRIMAL] = largest(primal, gaps);
    measures[STATIONARITY] = largest(p->unknowns, residuals);
    measures[COMPLEMENTARITY] = complementarity;
    measures[LARGEST_PRODUCT] = most;
    measures[LEAST_PRODUCT] = least;
    measures[MEAN_PRODUCT] = p->inequalities ? products / p->inequalities : 0.0;
    measures[INFEASIBILITY] = sum_of_sizes(primal, gaps);
}

int interior_factorise(Program p, const double *point, double damping)
{
    double *weights = p->weights;
    memset(weights, 0, sizeof(double) * (p->rows + p->unknowns));
    for (int i = 0; point && i < p->inequalities; i++)
        weights[p->inequality[i]] += point[z_of(p) + i] / point[s_of(p) + i];
    for (int i = 0; i < p->equalities; i++) weights[p->equality[i]] = p->equality_weight;
    for (int i = 0; i < p->unknowns; i++) weights[p->rows + i] += damping;
    return riccati_factorise(
        p->stages, p->states, p->sizes, p->hessian, p->dynamics, p->row_counts, p->gradients, weights,
        weights + p->rows, p->factors, p->first);
}

/* add the transposed Jacobian of (rows, unknowns) times numbers to a stationarity */
static void add_transposed(Program p, const double *numbers, double *stationarity)
{
    for (int i = 0; i < p->unknowns; i++) stationarity[i] += numbers[p->rows + i];
    riccati_rows_transposed(p->stages, p->sizes, p->row_counts, p->gradients, numbers, stationarity);
}

void interior_solve(Program p, const double *point, const double *residuals, double *step)
{
    const double *s = point + s_of(p), *z = point + z_of(p), *slacks = residuals ? residuals + s_of(p) : NULL;
    const double *equalities = residuals ? residuals + e_of(p) : NULL;
    double *de = step + e_of(p), *ds = step + s_of(p), *dz = step + z_of(p), *gaps = step + y_of(p);
    double *multipliers = p->multipliers;
    memset(multipliers, 0, sizeof(double) * (p->rows + p->unknowns));
    for (int i = 0; i < p->inequalities; i++) {
        dz[i] = (slacks ? dz[i] - z[i] * slacks[i] : dz[i]) / s[i];
        multipliers[p->inequality[i]] += p->sign[i] * dz[i];
    }
    for (int i = 0; equalities && i < p->equalities; i++)
        multipliers[p->equality[i]] -= equalities[i] * p->equality_weight;
    for (int i = 0; i < p->unknowns; i++) p->right_hand[i] = residuals ? -residuals[i] : 0.0;
    for (int i = 0; i < p->gaps; i++) p->changes[i] = residuals ? -residuals[y_of(p) + i] : 0.0;
    add_transposed(p, multipliers, p->right_hand);
    riccati_solve(
        p->stages, p->states, p->sizes, p->dynamics, p->factors, p->first, p->right_hand, p->changes,
        p->feedforward, p->cost_gradients, step, gaps);
    riccati_rows(p->stages, p->sizes, p->row_counts, p->gradients, step, p->changes);
    memcpy(p->changes + p->rows, step, sizeof(double) * p->unknowns);
    for (int i = 0; i < p->equalities; i++)
        de[i] = (p->changes[p->equality[i]] + (equalities ? equalities[i] : 0.0)) * p->equality_weight;
    for (int i = 0; i < p->inequalities; i++) {
        const double change = p->sign[i] * p->changes[p->inequality[i]];
        ds[i] = slacks ? change + slacks[i] : change;
        dz[i] -= z[i] / s[i] * change;
    }
}

/* how far numbers can go with their changes: at most all the way, and a part of it to zero */
static double length(int n, const double *values, const double *changes, double reach)
{
    double least = 0.0;
    for (int i = 0; i < n; i++) {
        const double ratio = changes[i] / values[i];
        if (ratio < least) least = ratio;
    }
    return least >= -reach ? 1.0 : -reach / least;
}

static void step_lengths(Program p, const double *point, const double *step, double reach, double *lengths)
{
    lengths[0] = length(p->inequalities, point + s_of(p), step + s_of(p), reach);
    lengths[1] = length(p->inequalities, point + z_of(p), step + z_of(p), reach);
}

/* the product of slack and multiplier i after parts of a step */
static inline double product_after(Program p, const double *point, const double *step, const double *lengths, int i)
{
    const int s = s_of(p) + i, z = z_of(p) + i;
    return (point[s] + lengths[0] * step[s]) * (point[z] + lengths[1] * step[z]);
}

static inline double within(double value, double least, double most)
{
    return value < least ? least : value > most ? most : value;
}

void interior_predictor_corrector(
    Program p, const struct interior_corrections *of, const double *point, const double *residuals,
    double barrier_min, double *step, double *lengths)
{
    const double *s = point + s_of(p), *z = point + z_of(p);
    double *predicted = p->predicted, average = 0.0, ahead = 0.0;
    if (!p->inequalities) { /* Newton's method */
        interior_solve(p, point, residuals, step);
        lengths[0] = lengths[1] = 1.0;
        return;
    }
    for (int i = 0; i < p->inequalities; i++) predicted[z_of(p) + i] = -s[i] * z[i];
    interior_solve(p, point, residuals, predicted);
    step_lengths(p, point, predicted, 1.0, lengths);
    for (int i = 0; i < p->inequalities; i++) {
        average += s[i] * z[i];
        ahead += product_after(p, point, predicted, lengths, i);
    }
    average /= p->inequalities, ahead /= p->inequalities;
    const double share = ahead / average, centring = share * share * share;
    double barrier = (centring < 1.0 ? centring : 1.0) * average;
    if (!(barrier > barrier_min)) barrier = barrier_min;
    const double most = of->spread * of->spread * (average > barrier ? average : barrier);
    for (int i = 0; i < p->inequalities; i++) {
        const double product = s[i] * z[i], half = 0.5 * product;
        const double least = -(half > barrier ? half : barrier); /* less would keep a product that is too large */
        step[z_of(p) + i] = barrier - product - within(predicted[s_of(p) + i] * predicted[z_of(p) + i], least, most);
    }
    interior_solve(p, point, residuals, step);

    const double reach = 1.0 - barrier > of->boundary_fraction ? 1.0 - barrier : of->boundary_fraction;
    step_lengths(p, point, step, reach, lengths);
    for (int round = 0; round < of->count; round++) {
        if ((lengths[0] < lengths[1] ? lengths[0] : lengths[1]) > of->length_enough) break;
        const double tried[2] = {fmin(1.0, lengths[0] + of->gain), fmin(1.0, lengths[1] + of->gain)};
        for (int i = 0; i < p->inequalities; i++) {
            const double product = product_after(p, point, step, tried, i);
            const double target = within(product, barrier / of->spread, of->spread * barrier) - product;
            p->correction[z_of(p) + i] = target > -of->spread * barrier ? target : -of->spread * barrier;
        }
        interior_solve(p, point, NULL, p->correction);
        for (int i = 0; i < size_of(p); i++) p->candidate[i] = step[i] + p->correction[i];
        double longer[2];
        step_lengths(p, point, p->candidate, reach, longer);
        if (longer[0] + longer[1] < lengths[0] + lengths[1] + of->gain_min) break;
        memcpy(step, p->candidate, sizeof(double) * size_of(p));
        memcpy(lengths, longer, sizeof longer);
    }
}
