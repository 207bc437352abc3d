"use strict";
// What the page of an actuator and the page of a fleet share.

const token = new URLSearchParams(location.search).get("token");
/** What every address of the server ends with. */
const query = token ? `?token=${encodeURIComponent(token)}` : "";

/** An action and its cause in words. */
const answerInWords = ({ command, detail }) => `${words(command)}${detail ? `: ${words(detail)}` : ""}`;
/** The actions that stand: the last one of each kind for each actuator, until a new flight begins. */
const standing = (state) =>
  [...new Map((state?.actions || []).map((action) => [`${action.actuator} ${action.command}`, action])).values()];
/** What stands in one line: "Actuator 1 shut down: external leakage". */
const headline = (state) => {
  const line = standing(state).map((action) => `${words(action.actuator)} ${answerInWords(action)}`.trim()).join("; ");
  return line.charAt(0).toUpperCase() + line.slice(1);
};

/** The alarm of a state; undefined as long as nobody knows it. A silent stream says nothing about its actuator. */
const alarmOf = (state) => (state?.is_silent ? "no_data" : state?.alarm);
