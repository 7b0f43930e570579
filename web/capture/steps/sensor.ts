// Which sensor: those that are there, why some cannot be used, and how to install what is missing.
import { button, h } from "../../src/ui/dom";
import { type App, type MakeStep, whenChanged } from "../app";
import { isSimulated, type Library, type SensorFound, type State } from "../daemon/types";
import { texts } from "../texts";

const t = texts.sensor;

export const sensor: MakeStep = (app) => {
  const list = h("ul", { class: "choices" });
  const libraries = h("ul", { class: "libraries" });
  const drivers = h(
    "section",
    { class: "panel" },
    h("h2", {}, t.librariesTitle),
    h("p", {}, t.librariesLead),
    libraries,
  );
  const lookAgain = async () => {
    let found = 0;
    const look = async () => {
      const state = await app.daemon.lookForSensors();
      found = state.sensors.length;
      return state;
    };
    if (await app.run(look)) app.say(t.looked(found));
  };
  const content = h(
    "div",
    {},
    h("p", { class: "lead" }, t.lead),
    h(
      "div",
      { class: "title-row" },
      h("h2", {}, t.listTitle),
      button(t.again, () => void lookAgain()),
    ),
    list,
    drivers,
  );
  const showSensors = whenChanged(
    (state: State) => [state.sensors, state.sensor?.address, state.board !== null] as const,
    ([sensors, open]) => {
      const focused = list.contains(document.activeElement) ? document.activeElement?.id : undefined;
      list.replaceChildren(...sensors.map((each, i) => sensorItem(app, each, open === each.address, i)));
      if (focused) document.getElementById(focused)?.focus();
    },
  );
  const showLibraries = whenChanged(
    (state: State) => state.libraries,
    (all) => {
      drivers.hidden = all.length === 0;
      libraries.replaceChildren(...all.map(libraryItem));
    },
  );
  return {
    content,
    update(state) {
      showSensors(state);
      showLibraries(state);
    },
  };
};

function sensorItem(app: App, found: SensorFound, isOpen: boolean, place: number): HTMLElement {
  const open = () => {
    app.say(t.opening);
    void app.run(() => (isOpen ? app.daemon.goBack("board") : app.daemon.openSensor(found.address)));
  };
  const isReal = !isSimulated(found.address);
  const status = isOpen ? t.inUse : found.usable ? t.ready : t.notReady;
  return h(
    "li",
    { class: "panel choice" },
    h(
      "div",
      {},
      h("h3", {}, found.model),
      h("p", { class: found.usable ? "chip chip-active" : "chip chip-draft" }, status),
      !isReal && h("p", { class: "hint" }, t.simulated),
      isReal && found.serial !== "" && h("p", { class: "hint" }, t.serial(found.serial)),
      found.problem !== null && h("p", { class: "problem" }, found.problem),
      found.advice !== null && advice(found.advice),
    ),
    found.usable &&
      button(isOpen ? t.goOn : t.use, open, {
        class: "primary",
        id: `sensor-${place}`,
        "aria-label": isOpen ? undefined : t.useNamed(found.model),
      }),
  );
}

function libraryItem(library: Library): HTMLElement {
  const state = library.found ? t.found(library.version ?? "") : t.missing;
  return h(
    "li",
    {},
    h("strong", {}, library.name),
    `: ${state}`,
    library.advice !== null && !library.found && advice(library.advice),
  );
}

function advice(text: string): HTMLElement {
  return h("p", { class: "advice" }, h("strong", {}, t.whatToDo), " ", text);
}
