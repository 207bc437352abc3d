/* The calls of a session, recorded for `servotwin prove --vectors`. Not part of an export. */
#ifndef MCDC_SESSION_H
#define MCDC_SESSION_H

#include "servotwin_session.h"

bool mcdc_session_start(servotwin_session *session);
const servotwin_outcome *mcdc_session_push(
    servotwin_session *session, const double *inputs, const double *measured, const double *twin);
void mcdc_session_switched_off(servotwin_session *session, int32_t actuator);
void mcdc_session_release(servotwin_session *session, int32_t actuator);
void mcdc_session_inhibit(servotwin_session *session, int32_t actuator, bool is_inhibited);
void mcdc_session_take_out(servotwin_session *session, int32_t sensor, bool is_out);

#endif
