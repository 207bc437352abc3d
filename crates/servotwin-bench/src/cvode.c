/* CVODE (BDF, dense, its own difference Jacobian) on the generated equations,
 * one variant after the other.
 *
 * Compiled behind the C source of the system, whose functions have the prefix
 * `t_`. Reads from standard input, all numbers as doubles: variants, samples,
 * sample period, tolerance, place of the command among the inputs, scales of
 * the states, number of pieces of the command, their beginnings, their cubics; then for every variant constants,
 * held values, inputs and start. Writes the samples of every variant to
 * standard output, and seconds of the processor and steps as the last two
 * numbers. */
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <time.h>

static double constants[T_CONSTANTS], held[T_HELD + 1], inputs[T_INPUTS], start[T_STATES];
static double *breaks, (*pieces)[4];
static int count, piece, moving;

static void get(double *numbers, size_t n)
{
    if (fread(numbers, sizeof *numbers, n, stdin) != n) exit(1);
}

static double number(void)
{
    double value;
    get(&value, 1);
    return value;
}

static void command(double time)
{
    while (piece + 1 < count && breaks[piece + 1] <= time) piece++;
    while (piece > 0 && breaks[piece] > time) piece--;
    double t = time - breaks[piece], *p = pieces[piece];
    inputs[moving] = p[0] + t * (p[1] + t * (p[2] + t * p[3]));
}

static int rates(sunrealtype time, N_Vector y, N_Vector f, void *unused)
{
    (void)unused;
    command(time);
    t_derivatives(constants, N_VGetArrayPointer(y), inputs, held, N_VGetArrayPointer(f));
    return 0;
}

int main(void)
{
    int variants = (int)number(), samples = (int)number();
    double period = number(), tolerance = number(), scales[T_STATES];
    moving = (int)number();
    double seconds = 0, steps = 0;
    get(scales, T_STATES);
    count = (int)number();
    breaks = malloc(count * sizeof *breaks);
    pieces = malloc(count * sizeof *pieces);
    get(breaks, count);
    get(&pieces[0][0], (size_t)count * 4);
    for (int variant = 0; variant < variants; variant++) {
        get(constants, T_CONSTANTS);
        get(held, T_HELD);
        get(inputs, T_INPUTS);
        get(start, T_STATES);
        clock_t begin = clock();
        SUNContext context;
        SUNContext_Create(NULL, &context);
        N_Vector y = N_VMake_Serial(T_STATES, start, context);
        N_Vector absolute = N_VNew_Serial(T_STATES, context);
        for (int k = 0; k < T_STATES; k++) N_VGetArrayPointer(absolute)[k] = tolerance * scales[k];
        SUNMatrix matrix = SUNDenseMatrix(T_STATES, T_STATES, context);
        SUNLinearSolver linear = SUNLinSol_Dense(y, matrix, context);
        void *cvode = CVodeCreate(CV_BDF, context);
        CVodeInit(cvode, rates, 0, y);
        CVodeSVtolerances(cvode, tolerance, absolute);
        CVodeSetLinearSolver(cvode, linear, matrix);
        CVodeSetMaxNumSteps(cvode, 10000000);
        CVodeSetMaxErrTestFails(cvode, 100);
        CVodeSetMaxConvFails(cvode, 1000);
        CVodeSetStopTime(cvode, (samples - 1) * period);
        for (int i = 0; i < samples; i++) {
            double reached;
            int failed = i > 0 && CVode(cvode, i * period, y, &reached, CV_NORMAL) < 0;
            if (failed) fprintf(stderr, "variant %d stopped at %g s\n", variant, reached);
            fwrite(N_VGetArrayPointer(y), sizeof(double), T_STATES, stdout);
        }
        long n;
        CVodeGetNumSteps(cvode, &n);
        steps += n;
        CVodeFree(&cvode);
        SUNLinSolFree(linear);
        SUNMatDestroy(matrix);
        N_VDestroy(absolute);
        N_VDestroy(y);
        SUNContext_Free(&context);
        seconds += (double)(clock() - begin) / CLOCKS_PER_SEC;
    }
    double work[2] = {seconds, steps};
    fwrite(work, sizeof *work, 2, stdout);
    return 0;
}
