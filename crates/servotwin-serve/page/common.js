"use strict";
// What the page of an actuator and the page of a fleet share.

const token = new URLSearchParams(location.search).get("token");
/** What every address of the server ends with. */
const query = token ? `?token=${encodeURIComponent(token)}` : "";
const $ = (id) => document.getElementById(id);
/** A name as viewers read it. */
const words = (id) => id.replaceAll("_", " ").replaceAll(".", ": ");

/** The alarm of a state; undefined as long as nobody knows it. A silent stream says nothing about its actuator. */
const alarmOf = (state) => (state?.is_silent ? "no_data" : state?.alarm);
