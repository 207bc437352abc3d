/*
 * The functions that FMI 2.0 and 3.0 have in common. The interface of a version includes this once. Before, it defines NAME,
 * which adds its prefix, STATE and DESERIALIZE, the names of functions of states, and `logged`.
 */
static NAME(Status) failed(const instance *of, const char *why)
{
    return logged(of, NAME(Error), why);
}

static NAME(Status) well(const instance *of, bool is_well, const char *why)
{
    return is_well ? NAME(OK) : failed(of, why);
}

FUNCTION(void, NAME(FreeInstance), void *c)
{
    free(c);
}

FUNCTION(NAME(Status), NAME(ExitInitializationMode), void *c)
{
    instance *of = c;
    return well(of, servotwin_fmu_begin(&of->fmu), SERVOTWIN_FMU_NO_BEGINNING);
}

FUNCTION(NAME(Status), NAME(Reset), void *c)
{
    instance *of = c;
    servotwin_fmu_reset(&of->fmu);
    return NAME(OK);
}

/* Changes of mode that need nothing. */
#define NOTHING_TO_DO(name) \
    FUNCTION(NAME(Status), name, void *c) \
    { \
        return NAME(OK); \
    }

NOTHING_TO_DO(NAME(EnterEventMode))
NOTHING_TO_DO(NAME(EnterContinuousTimeMode))
NOTHING_TO_DO(NAME(Terminate))

FUNCTION(NAME(Status), STATE(Get), void *c, void **into)
{
    const instance *of = c;
    *into = servotwin_fmu_copied(&of->fmu, *into);
    return well(of, *into != NULL, SERVOTWIN_FMU_NO_MEMORY);
}

FUNCTION(NAME(Status), STATE(Set), void *c, void *from)
{
    instance *of = c;
    (void)servotwin_fmu_copied(from, &of->fmu);
    return well(of, from != NULL, SERVOTWIN_FMU_NO_STATE);
}

FUNCTION(NAME(Status), STATE(Free), void *c, void **saved)
{
    free(*saved);
    *saved = NULL;
    return NAME(OK);
}

FUNCTION(NAME(Status), STATE(Serialize), void *c, void *saved, NAME(Byte) bytes[], size_t size)
{
    return well(c, servotwin_fmu_serialize(saved, bytes, size), SERVOTWIN_FMU_TOO_SHORT);
}

FUNCTION(NAME(Status), DESERIALIZE, void *c, const NAME(Byte) bytes[], size_t size, void **into)
{
    const void *state = servotwin_fmu_state_in(bytes, size);
    if (state == NULL) {
        return failed(c, SERVOTWIN_FMU_NO_STATE);
    }
    *into = servotwin_fmu_copied(state, *into);
    return well(c, *into != NULL, SERVOTWIN_FMU_NO_MEMORY);
}

FUNCTION(NAME(Status), NAME(SetTime), void *c, double time_s)
{
    instance *of = c;
    return well(of, servotwin_fmu_set_time(&of->fmu, time_s), SERVOTWIN_FMU_NO_TIME);
}

FUNCTION(NAME(Status), NAME(SetContinuousStates), void *c, const double states[], size_t count)
{
    instance *of = c;
    return well(of, servotwin_fmu_set_states(&of->fmu, states, count), SERVOTWIN_FMU_NO_STATES);
}

FUNCTION(NAME(Status), NAME(GetContinuousStates), void *c, double states[], size_t count)
{
    instance *of = c;
    return well(of, servotwin_fmu_states(&of->fmu, states, count), SERVOTWIN_FMU_UNKNOWN);
}

FUNCTION(NAME(Status), NAME(GetNominalsOfContinuousStates), void *c, double nominals[], size_t count)
{
    servotwin_fmu_nominals(nominals, count);
    return NAME(OK);
}

/* Logs a warning about the length of a step, once. */
static NAME(Status) stepped(instance *of, double time_s, double step_s)
{
    const char *warning = servotwin_fmu_step_warning(step_s);
    const char *refusal = servotwin_fmu_step(&of->fmu, time_s, step_s);
    NAME(Status) status = well(of, refusal == NULL, refusal);
    if ((status == NAME(OK)) && (warning != NULL) && !of->has_warned) {
        of->has_warned = true;
        status = logged(of, NAME(Warning), warning);
    }
    return status;
}
