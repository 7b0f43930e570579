// All English texts of the scanner's page. Another language is another object of this shape.
import type { BackStep } from "./daemon/client";
import type { AutoMode, Light, Paper, StepName } from "./daemon/types";

const plural = (n: number, one: string, many: string): string => `${n} ${n === 1 ? one : many}`;

const oClock = ([first, last]: readonly [number, number]): string =>
  first === last ? `${first} o'clock` : `${first} to ${last} o'clock`;

const list = (parts: readonly string[]): string =>
  parts.length < 2 ? parts.join("") : `${parts.slice(0, -1).join(", ")} and ${parts.at(-1)}`;

export type ShownStep = StepName | "listing";

export const texts = {
  siteName: "Allround scanner",
  brand: "Allround",
  skipToContent: "Skip to content",
  footer:
    "Everything on this page comes from the program on your own computer. Nothing is sent before you publish.",

  common: {
    noReason: "it did not fit the others.",
  },

  stages: {
    label: "Steps",
    names: { sensor: "Sensor", board: "Board", views: "Views", result: "3D model" } as Record<
      BackStep,
      string
    >,
    publish: "Publish",
    done: "done",
  },

  titles: {
    sensor: "Choose your sensor",
    board: "Print or choose the board",
    views: "Take views from all sides",
    building: "Building the 3D model",
    result: "Look at your 3D model",
    listing: "Publish your listing",
    publishing: "Sending your listing",
    published: "Your listing is on the server",
  } as Record<ShownStep, string>,

  connection: {
    connecting: "Connecting to the scanner program…",
    lost: "The connection to the scanner program is lost. Is it still running? This page tries again by itself.",
    refused:
      "This page belongs to an earlier start of the scanner program. Close it and open the address that the program printed last.",
    noToken:
      "This address lacks its key. Open the whole address that the scanner program printed when it started.",
    orderLost: "The scanner program did not answer. Is it still running? Try again in a moment.",
    unreadable: "The scanner program's answer could not be read. Please try again.",
    back: "The connection is back.",
  },

  quit: {
    open: "End the program",
    title: "End the scanner program?",
    text: (folder: string) => `What you have taken stays on this computer, in ${folder}.`,
    textPlain: "What you have taken stays on this computer.",
    yes: "End it",
    no: "Go on scanning",
    endedTitle: "The scanner program has ended",
    ended: "You can close this page now.",
  },

  folder: (folder: string, free: string) => `Kept in ${folder}, ${free} free`,

  sensor: {
    lead: "Plug the Kinect into its power supply and into a USB port. If you have none at hand, try everything with the simulated one.",
    listTitle: "Sensors",
    use: "Use this sensor",
    useNamed: (model: string) => `Use this sensor: ${model}`,
    inUse: "in use",
    ready: "ready",
    notReady: "cannot be used yet",
    simulated: "No hardware needed: a product on a board, as a Kinect would see it.",
    serial: (serial: string) => `Serial number ${serial}`,
    again: "Look again",
    looked: (n: number) => `${plural(n, "sensor", "sensors")} found.`,
    opening: "Starting the sensor…",
    goOn: "Go on with this sensor",
    whatToDo: "What to do:",
    librariesTitle: "Programs that speak to a Kinect",
    librariesLead: "One of them is enough.",
    found: (version: string) => `found${version === "" ? "" : `, version ${version}`}`,
    missing: "not installed",
  },

  board: {
    lead: "The product stands on a sheet with printed marks. They tell the scanner where every view was taken from.",
    steps: [
      "Choose the size: the product must stand inside, with marks still to be seen round it.",
      "Print the PDF at 100 % (“actual size”, never “fit to page”).",
      "Hold a ruler against the printed line: it must be exactly 100 mm long. If it is not, print again.",
      "Lay the sheet flat, or tape it onto a stiff board, and put the product in the middle.",
    ],
    papers: {
      a4: { name: "A4", fits: "for things up to 19 × 10 cm, like a cup" },
      a3: { name: "A3", fits: "for things up to 29 × 17 cm, like a shoe" },
      a2: { name: "A2", fits: "for things up to 45 × 27 cm, like a toaster" },
    } as Record<Paper, { name: string; fits: string }>,
    download: (paper: string) => `Download PDF of the ${paper} board`,
    downloadShort: "Download PDF",
    use: (paper: string) => `Use the ${paper} board`,
    simulated: "The simulated sensor has its own board: choose any size and go on, no printing needed.",
    other: "I have another board",
    file: "Board description (board.json)",
    fileHint: "The file that scan-product wrote beside the board you printed.",
    useFile: "Use this file",
    needsFile: "Choose a file first.",
    badFile:
      "This file is not a board description: it holds no JSON. Choose the board.json beside your board.",
    current: (name: string, tags: number) => `Now in use: ${name}, ${plural(tags, "mark", "marks")}.`,
    goOn: "Go on with this board",
  },

  live: {
    color: "Colour picture of the sensor",
    depth:
      "Depth picture of the sensor: near is warm, far is cold, grey will be cut away, black was not measured",
    depthTitle: "Depth",
    depthHint: "Grey will be cut away. Black could not be measured.",
    noDepth: "No depth picture yet",
    waiting: "Waiting for pictures from the sensor…",
    lights: {
      green: "Ready: take the view",
      yellow: "Almost ready",
      red: "Not yet",
    } as Record<Light, string>,
    fallback: {
      green: "Everything is in sight.",
      yellow: "A view can be better than this.",
      red: "A view cannot be taken now.",
    } as Record<Light, string>,
    facts: (pictures: number, depthPercent: number, metres: string | null, lost: number) =>
      [
        `${pictures} pictures a second`,
        metres === null ? null : `${metres} m to the product`,
        `${depthPercent} % of the depth measured`,
        lost > 0 ? `${plural(lost, "packet", "packets")} lost` : null,
      ]
        .filter((part) => part !== null)
        .join(" · "),
    trouble: (text: string) => `The sensor has a problem: ${text}`,
  },

  views: {
    lead: "Walk round the product and take 8 to 12 views. The product and the board must not move meanwhile.",
    take: "Take view",
    takeHint: "or press the space bar",
    taking: (frames: number, of: number) => `Hold still: picture ${frames} of ${of}`,
    takingLabel: "Pictures of this view",
    begun: "Taking a view. Hold still.",
    taken: (number: number, seen: string) => `View ${number} taken. ${seen}`,
    removed: (number: number) => `View ${number} removed.`,
    nextIn: (seconds: number) => `Next view in ${seconds} s`,
    autoTitle: "When is a view taken?",
    modes: {
      manual: "When I say so",
      still: "By itself when nothing moves",
      timer: "Every few seconds",
    } as Record<AutoMode, string>,
    seconds: "Seconds",
    stationTitle: "Walk round (simulated sensor)",
    left: "Step left",
    right: "Step right",
    nextGap: "Go to the next unseen side",
    walked: (hour: number | null) => (hour === null ? "Walking." : `Walking to ${hour} o'clock.`),
    ringTitle: "Seen so far",
    ringFrom: "Seen from above; your first view is at 6 o'clock.",
    youStart: "first view",
    noneYet: "No view yet. Stand where it is convenient: that will be 6 o'clock.",
    allSeen: "Every side has been seen.",
    unseen: (ranges: readonly [number, number][]) => `Still unseen: ${list(ranges.map(oClock))}.`,
    count: (n: number) => plural(n, "view", "views"),
    listTitle: "Views",
    view: (number: number) => `View ${number}`,
    facts: (hour: number | null, points: string) =>
      [hour === null ? null : `${hour} o'clock`, `${points} points`]
        .filter((part) => part !== null)
        .join(" · "),
    remove: "Remove",
    removeNamed: (number: number) => `Remove view ${number}`,
    undoLast: "Undo the last view",
    previewTitle: "Preview",
    previewName: "the product so far",
    previewEmpty: "The product appears here after the first view and grows with every further one.",
    previewPoints: (points: string) => `${points} points so far`,
    build: "Build the 3D model",
    buildFirst: "Take at least 3 views first.",
    buildSome: (unseen: number) =>
      `You can build now, but ${plural(unseen, "side is", "sides are")} still unseen and will be missing.`,
    buildAll: "All sides are there: you can build.",
  },

  building: {
    lead: "This takes about as long as making a cup of tea. You can stop at any time; your views are kept.",
    stages: {
      load: "Reading the pictures",
      markers: "Finding the marks on the board",
      calibrate: "Checking the depth against the board",
      cut: "Cutting the product out",
      place: "Placing the views by their surfaces",
      align: "Fitting the views together",
      fuse: "Making one surface of all views",
      outcome: "Measuring and judging",
      write: "Writing the model",
    } as Record<string, string>,
    progress: "Progress of the build",
    step: (done: number, of: number) => `${done} of ${of}`,
    starting: "Starting…",
    cancel: "Stop building",
  },

  result: {
    name: "your product",
    lead: "Turn it round. If something does not belong to the product, mark it and remove it.",
    size: "Size",
    noSize: "The size could not be measured.",
    sides: ["Length", "Width", "Height"],
    side: (cm: string, uncertainty: string | null) =>
      `${cm} cm${uncertainty === null ? "" : ` ${uncertainty}`}`,
    verdictTitle: "How good is it?",
    verdicts: {
      good: "Good: the views fit together well. You can publish it as it is.",
      acceptable:
        "Acceptable: the shape is right, small parts may be rough or missing. More views make it better.",
      poor: "Poor: parts are missing or uncertain. Take more views before you publish.",
    } as Record<string, string>,
    warnings: "Please note",
    leftOut: (number: number, reason: string) => `View ${number} was left out: ${reason}`,
    points: (points: string) => `${points} points`,
    removed: (points: string) => `${points} points removed by hand`,
    goOn: "Go on to publish",
    more: "Take more views",
  },

  cut: {
    title: "Remove what does not belong",
    tools: "Tools",
    turn: "Turn",
    box: "Box",
    lasso: "Lasso",
    front: "Only what is in front",
    helpTurn: "Turn the model until what is to go stands free. Then choose Box or Lasso and draw round it.",
    helpBox:
      "Drag a box over what is to go. With the keyboard: arrow keys move the box, Shift + arrows change its size, Enter selects, Delete removes, Escape clears. Hold Shift while dragging to add to the selection.",
    helpLasso: "Draw round what is to go. Hold Shift to add to the selection. Delete removes, Escape clears.",
    surface: (tool: string) => `${tool} over the 3D model`,
    surfaceRole: "selection area",
    none: "Nothing is selected.",
    selected: (points: string) => `${points} points selected.`,
    boxAt: (x: number, y: number, width: number, height: number) =>
      `Box at ${x} % from the left and ${y} % from the top, ${width} % wide, ${height} % high.`,
    remove: "Remove selected",
    clear: "Clear",
    undo: "Undo",
    gone: "The selected points are removed.",
    undone: "The last removal is undone.",
    nothing: "Select something first.",
  },

  listing: {
    lead: "Check what will be sent, fill in the form, then publish.",
    leavingTitle: "What will leave this computer",
    leavingLead: "Exactly this, and only when you press “Publish”:",
    total: (size: string) => `Together ${size}, and the text of the form.`,
    staysTitle: "What stays here",
    formTitle: "Your listing",
    description: "Description",
    serverTitle: "Where to",
    server: "Address of the shop",
    serverHint: "For example https://shop.example",
    token: "Upload token",
    tokenHint: "You get it in the shop under “Upload tokens”. It is forgotten when you close this page.",
    badServer: "Write the shop's whole address, beginning with https:// or http://.",
    submit: "Publish",
    back: "Back to the 3D model",
    failed: (error: string) => `Publishing did not work: ${error}`,
  },

  publishing: {
    phases: {
      uploading: "Uploading",
      processing: "The shop is preparing the 3D view",
      done: "Done",
      failed: "It did not work",
    } as Record<string, string>,
    starting: "Connecting to the shop…",
    progress: "Progress of the upload",
    sent: (sent: string, total: string) => `${sent} of ${total}`,
  },

  published: {
    lead: "Your product is in the shop. If the shop checks new listings, buyers see it once it is activated.",
    address: "Address of your listing",
    another: "Scan another product",
    anotherHint: "Sensor and board stay as they are.",
  },
};
