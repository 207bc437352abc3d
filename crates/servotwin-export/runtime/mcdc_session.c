/* The calls of a session, recorded for `servotwin prove --vectors`. Not part of an export. */
#include "mcdc_session.h"

#include "mcdc.h"

bool mcdc_session_start(servotwin_session *session)
{
    mcdc_record(true);
    const bool rounds_twice = servotwin_session_start(session);
    mcdc_record(false);
    return rounds_twice;
}

const servotwin_outcome *mcdc_session_push(
    servotwin_session *session, const double *inputs, const double *measured, const double *twin)
{
    mcdc_record(true);
    const servotwin_outcome *outcome = servotwin_session_push(session, inputs, measured, twin);
    mcdc_record(false);
    return outcome;
}

void mcdc_session_switched_off(servotwin_session *session, int32_t actuator)
{
    mcdc_record(true);
    servotwin_session_switched_off(session, actuator);
    mcdc_record(false);
}

void mcdc_session_release(servotwin_session *session, int32_t actuator)
{
    mcdc_record(true);
    servotwin_session_release(session, actuator);
    mcdc_record(false);
}

void mcdc_session_inhibit(servotwin_session *session, int32_t actuator, bool is_inhibited)
{
    mcdc_record(true);
    servotwin_session_inhibit(session, actuator, is_inhibited);
    mcdc_record(false);
}

void mcdc_session_take_out(servotwin_session *session, int32_t sensor, bool is_out)
{
    mcdc_record(true);
    servotwin_session_take_out(session, sensor, is_out);
    mcdc_record(false);
}
