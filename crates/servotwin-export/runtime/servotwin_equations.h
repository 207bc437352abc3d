/*
 * The equations of the system and the linear algebra of a step, written by servotwin for one system. All values are in SI
 * units. servotwin_twin_sizes.h has the lengths of the arrays.
 */
#ifndef SERVOTWIN_EQUATIONS_H
#define SERVOTWIN_EQUATIONS_H

#include "servotwin_exact.h"
#include "servotwin_math.h"
#include "servotwin_twin_sizes.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Applies faults to the parameters of a healthy system. An intensity is 0 (healthy) to 1. */
void servotwin_twin_faults(const double *intensities, double *parameters);

/* The constants of the equations, from parameters. */
void servotwin_twin_constants(const double *parameters, double *constants);

/* Writes parameters and temperatures that stand in for open signal inputs into the variables. */
void servotwin_twin_stand_ins(const double *parameters, double *variables);

/* Computes all sums, among them the derivatives, from states, inputs and held values. */
void servotwin_twin_evaluate(const double *constants, double *variables);

/* The same, and the gradients. */
void servotwin_twin_begin(const double *constants, double *variables, double *gradients);

/* Computes the derivatives of the states only. */
void servotwin_twin_motion(const double *constants, double *variables);

/* Factors diagonal[0] * I - J. */
void servotwin_twin_factor(const double *diagonal, const double *gradients, double *factors);

/* Solves the first stage and the others; the result replaces the right-hand side. */
void servotwin_twin_solve_first(
    const double *variables, const double *slope_factor, const double *gradients, const double *factors, double *right);
void servotwin_twin_solve(
    const double *variables, const double *slope_factor, const double *gradients, const double *factors, double *right);

/* Argument and right-hand side of a stage from the second (1) on. */
void servotwin_twin_sums(int32_t stage, const double *reciprocal, const double *y, const double *stages, double *variables,
    double *right);

/* Runs the sampled equations of a clock and stores the values that it holds. An evaluation must precede it. */
void servotwin_twin_tick(int32_t clock, const double *constants, double *variables);

/* x^exponent for a positive, normal x. */
double servotwin_twin_power(double x, double exponent);

/* The transcendental functions of the equations. They are less accurate than those of a C library, and the same everywhere. */
double servotwin_twin_rounded(double x);
double servotwin_twin_scaled(double x, double exponent);
double servotwin_twin_mantissa(double x);
double servotwin_twin_exponent(double x);
double servotwin_twin_exp(double x);
double servotwin_twin_exp2(double x);
double servotwin_twin_log2(double x);
double servotwin_twin_tanh(double x);
double servotwin_twin_sin(double x);
double servotwin_twin_cos(double x);

#ifdef __cplusplus
}
#endif

#endif
