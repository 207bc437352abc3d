/* What Frama-C analyses: a diagnosis that takes any number of samples with any finite values. */
#include "servotwin_session.h"
#include "servotwin_tables.h"

#include "__fc_builtin.h"

static servotwin_session session;

static void fill(servotwin_real *values, int count)
{
    for (int i = 0; i < count; i++) {
        values[i] = (servotwin_real)Frama_C_double_interval(-1e12, 1e12);
    }
}

int main(void)
{
    servotwin_real inputs[SERVOTWIN_INPUTS];
    servotwin_real measured[SERVOTWIN_SENSORS];
    servotwin_real expected[SERVOTWIN_SENSORS];
    (void)servotwin_session_start(&session);
    while (Frama_C_nondet(0, 1) != 0) {
        fill(inputs, SERVOTWIN_INPUTS);
        fill(measured, SERVOTWIN_SENSORS);
        fill(expected, SERVOTWIN_SENSORS);
        (void)servotwin_session_push(&session, inputs, measured, expected);
    }
    return 0;
}
