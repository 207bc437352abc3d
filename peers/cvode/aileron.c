/* Integrates the aileron with CVODE: the C that servotwin-model's c_source wrote,
 * BDF with Newton and a dense difference Jacobian, relative tolerance 1e-10 and
 * absolute tolerance 1e-10 of every state's scale, restarted wherever an input
 * has a break. Reads cases.txt (format: crates/servotwin/examples/write_peer_input.rs),
 * prints a table of all states. See run.sh. */

#include "generated/aileron.c"

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <sundials/sundials_version.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#define TOLERANCE 1e-10
/* Times closer together than this are the same, s. */
#define SAME_S 1e-9

struct signal {
    int pieces;
    double *begin_s;
    double (*cubic)[4];
    int at;
};

struct variant {
    double parameters[AILERON_PARAMETERS];
    double constants[AILERON_CONSTANTS];
    double held[AILERON_HELD + 1];
    struct signal inputs[AILERON_INPUTS];
};

static void need(int good, const char *what)
{
    if (good) return;
    fprintf(stderr, "aileron: %s\n", what);
    exit(1);
}

static double number(FILE *file)
{
    double value;
    need(fscanf(file, "%lf", &value) == 1, "a number is missing in cases.txt");
    return value;
}

static void read_signal(FILE *file, struct signal *signal)
{
    signal->pieces = (int)number(file);
    signal->begin_s = malloc(signal->pieces * sizeof *signal->begin_s);
    signal->cubic = malloc(signal->pieces * sizeof *signal->cubic);
    need(signal->begin_s && signal->cubic, "no memory");
    for (int k = 0; k < signal->pieces; k++) {
        signal->begin_s[k] = number(file);
        for (int i = 0; i < 4; i++) signal->cubic[k][i] = number(file);
    }
    signal->at = 0;
}

static double value(const struct signal *signal, double time_s)
{
    const double *c = signal->cubic[signal->at];
    double tau = time_s - signal->begin_s[signal->at];
    return c[0] + tau * (c[1] + tau * (c[2] + tau * c[3]));
}

static int rates(realtype time_s, N_Vector y, N_Vector dy, void *data)
{
    struct variant *variant = data;
    double inputs[AILERON_INPUTS];
    for (int i = 0; i < AILERON_INPUTS; i++) inputs[i] = value(&variant->inputs[i], time_s);
    aileron_derivatives(variant->constants, N_VGetArrayPointer(y), inputs, variant->held,
                        N_VGetArrayPointer(dy));
    return 0;
}

/* Chooses the pieces that hold from a time on; gives the next break. */
static double enter(struct variant *variant, double time_s)
{
    double next_s = 1e300;
    for (int i = 0; i < AILERON_INPUTS; i++) {
        struct signal *s = &variant->inputs[i];
        while (s->at + 1 < s->pieces && s->begin_s[s->at + 1] <= time_s + SAME_S) s->at++;
        if (s->at + 1 < s->pieces) next_s = fmin(next_s, s->begin_s[s->at + 1]);
    }
    return next_s;
}

static void print_row(const char *name, double time_s, N_Vector y)
{
    printf("%s,%.1f", name, time_s);
    for (int i = 0; i < AILERON_STATES; i++) printf(",%.10g", N_VGetArrayPointer(y)[i]);
    printf("\n");
}

static void integrate(const char *name, struct variant *variant, N_Vector y, N_Vector tolerance,
                      double duration_s, double period_s, SUNContext context)
{
    void *cvode = CVodeCreate(CV_BDF, context);
    SUNMatrix matrix = SUNDenseMatrix(AILERON_STATES, AILERON_STATES, context);
    SUNLinearSolver solver = SUNLinSol_Dense(y, matrix, context);
    need(cvode && matrix && solver, "no memory");
    need(CVodeInit(cvode, rates, 0.0, y) == CV_SUCCESS, "CVodeInit");
    need(CVodeSVtolerances(cvode, TOLERANCE, tolerance) == CV_SUCCESS, "tolerances");
    need(CVodeSetUserData(cvode, variant) == CV_SUCCESS, "user data");
    need(CVodeSetLinearSolver(cvode, solver, matrix) == CV_SUCCESS, "linear solver");
    need(CVodeSetMaxNumSteps(cvode, 10000000) == CV_SUCCESS, "step limit");
    double time_s = 0.0;
    int sample = 1;
    long steps = 0;
    double next_break_s = enter(variant, time_s);
    print_row(name, 0.0, y);
    while (time_s < duration_s - SAME_S) {
        double sample_s = sample * period_s;
        double end_s = fmin(sample_s, next_break_s);
        need(CVodeSetStopTime(cvode, end_s) == CV_SUCCESS, "stop time");
        realtype reached;
        int flag = CVode(cvode, end_s, y, &reached, CV_NORMAL);
        if (flag < 0) {
            fprintf(stderr, "aileron: %s failed at %g s: %d\n", name, reached, flag);
            exit(1);
        }
        time_s = end_s;
        if (time_s > next_break_s - SAME_S) {
            long more;
            CVodeGetNumSteps(cvode, &more);
            steps += more;
            next_break_s = enter(variant, time_s);
            need(CVodeReInit(cvode, time_s, y) == CV_SUCCESS, "restart");
        }
        if (time_s > sample_s - SAME_S) {
            print_row(name, sample * period_s, y);
            sample++;
        }
    }
    fprintf(stderr, "%s: %ld steps\n", name, steps);
    SUNLinSolFree(solver);
    SUNMatDestroy(matrix);
    CVodeFree(&cvode);
}

int main(int count, char **arguments)
{
    need(count == 2, "usage: aileron cases.txt");
    FILE *file = fopen(arguments[1], "r");
    need(file != NULL, "cases.txt cannot be read");
    char version[32], word[128];
    SUNDIALSGetVersion(version, sizeof version);
    printf("# peer: CVODE of SUNDIALS %s, BDF, tolerance 1e-10, on the generated C source\n", version);
    printf("# written by peers/cvode/run.sh\ncase,time_s");
    int cases = (int)number(file);
    double duration_s = number(file), period_s = number(file);
    for (int i = 0; i < AILERON_STATES; i++) {
        need(fscanf(file, "%127s", word) == 1, "a name is missing in cases.txt");
        printf(",%s", word);
    }
    printf("\n");
    SUNContext context;
    need(SUNContext_Create(NULL, &context) == 0, "no context");
    N_Vector y = N_VNew_Serial(AILERON_STATES, context);
    N_Vector tolerance = N_VNew_Serial(AILERON_STATES, context);
    for (int i = 0; i < AILERON_STATES; i++)
        N_VGetArrayPointer(tolerance)[i] = TOLERANCE * number(file);
    static struct variant variant;
    for (int k = 0; k < cases; k++) {
        need(fscanf(file, "%127s", word) == 1, "a case is missing in cases.txt");
        for (int i = 0; i < AILERON_PARAMETERS; i++) variant.parameters[i] = number(file);
        for (int i = 0; i < AILERON_STATES; i++) N_VGetArrayPointer(y)[i] = number(file);
        for (int i = 0; i < AILERON_INPUTS; i++) read_signal(file, &variant.inputs[i]);
        aileron_constants(variant.parameters, variant.constants);
        aileron_held(variant.parameters, variant.held);
        integrate(word, &variant, y, tolerance, duration_s, period_s, context);
    }
    return 0;
}
