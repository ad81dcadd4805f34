// The tank in three dimensions: what is drawn, how it is turned, and its controls.

const INK = [0.1, 0.17, 0.24]; // of lines and points, on a wall that is pale in every look
const NEARER = 5e-4; // lines and points stand before the wall, part of the depth
const [REJECTED, CHOSEN] = [[0.05, 0.05, 0.05, 1], [0.85, 0.4, 0, 0.9]];
const STEEL = [0.66, 0.71, 0.76, 1]; // of a tank without deviations

{
  const box = document.getElementById("view");
  const data = box && dataOf("tank");
  if (data) {
    box.hidden = false;
    const scene = sceneOn(box.querySelector("canvas"));
    if (scene) runView(box, data, scene);
    else refuseView(box);
  }
}

function refuseView(box) {
  for (const part of box.querySelectorAll(".stage, .camera, .fields, .legend, .note")) {
    part.hidden = true;
  }
  box.querySelector(".fallback").hidden = false;
}

function runView(box, { shell, solid }, scene) {
  const HOME = { yaw: 0.5, pitch: 0.35, distance: 3.6 };
  const camera = { ...HOME };
  const canvas = box.querySelector("canvas");
  const tank = shell ? shellMesh(shell) : turnedMesh(solid);
  const points = shell ? pointVertices(shell) : null;
  const { gl } = scene;
  const parts = {
    wall: scene.uploaded(tank.vertices, tank.triangles),
    points: points && scene.uploaded(points),
    rejected: shell?.rejected.length ? scene.uploaded(rejectedVertices(shell)) : null,
    disc: scene.uploaded(discVertices()),
  };
  const extent = extentOf(tank.vertices, shell?.radius_m ?? 1);
  const controls = shell ? deviationControls(box, shell, tank.vertices, () => draw()) : null;
  const labels = labelsOf(box, shell, points);
  let level = null;
  let chosen = -1; // number of the rejected point that is looked at
  let waiting = false;

  const drawNow = () => {
    waiting = false;
    const ratio = canvas.clientWidth / Math.max(canvas.clientHeight, 1);
    const lens = perspective(0.6 / Math.min(ratio, 1), ratio, 0.1, 50);
    const eye = product(lens, orbit(camera.yaw, camera.pitch, camera.distance));
    const common = {
      radius: shell?.radius_m ?? 1, middle: extent.middle, scale: extent.scale, lift: 0, wide: 1, nearer: 0,
      exaggeration: 0, chosen: 0, limit: 0, lit: 0, ...(controls?.settings() ?? {}),
    };
    scene.begin(eye);
    scene.draw(parts.wall, gl.TRIANGLES, { ...common, lit: 1 }, STEEL);
    scene.draw(parts.wall, gl.LINE_STRIP, { ...common, limit: 0, nearer: NEARER },
      [...INK, 0.55], tank.outlines);
    if (controls?.showPoints()) {
      const size = 5 * Math.min(window.devicePixelRatio || 1, 2);
      scene.draw(parts.points, gl.POINTS, { ...common, limit: 0, nearer: 2 * NEARER, wide: size }, [...INK, 1]);
    }
    if (parts.rejected) {
      const size = 7 * Math.min(window.devicePixelRatio || 1, 2);
      const bare = { ...common, limit: 0, nearer: 3 * NEARER };
      scene.draw(parts.rejected, gl.POINTS, { ...bare, wide: size }, REJECTED);
      if (chosen >= 0) {
        scene.draw(parts.rejected, gl.POINTS, { ...bare, nearer: 1, wide: 2.6 * size }, CHOSEN, [[chosen, 1]]);
      }
    }
    if (shell && level !== null) {
      const still = { ...common, exaggeration: 0, limit: 0, lift: level };
      scene.draw(parts.disc, gl.TRIANGLE_FAN, still, [0.1, 0.45, 0.7, 0.35]);
    }
    labels.place(eye, extent, common, controls?.showNames() ?? false);
  };
  const draw = () => {
    if (!waiting) requestAnimationFrame(drawNow);
    waiting = true;
  };

  steer(box, canvas, camera, HOME, draw);
  if (shell && typeof whenDipChanges === "function") {
    whenDipChanges((dip) => {
      level = dip === null ? null : dip + shell.zero_m;
      draw();
    });
  }
  whenPointChosen((name) => {
    chosen = shell ? shell.rejected.findIndex((one) => one.name === name) : -1;
    if (chosen >= 0) { // from where it is seen
      camera.yaw = Math.PI + (Math.PI * shell.rejected[chosen].azimuth) / 180;
    }
    draw();
  });
  lookChanged.push(draw);
  new ResizeObserver(draw).observe(canvas);
  draw();
}

/** {middle height, scale} by which the tank fits into a ball of radius 1. */
function extentOf(vertices, radius) {
  let [low, high, wide] = [Infinity, -Infinity, 0];
  for (let i = 0; i < vertices.length; i += PER_VERTEX) {
    low = Math.min(low, vertices[i + 2]);
    high = Math.max(high, vertices[i + 2]);
    wide = Math.max(wide, radius * Math.hypot(vertices[i], vertices[i + 1]));
  }
  return { middle: (low + high) / 2, scale: Math.hypot(wide, (high - low) / 2) };
}

/** What deviations count from, how far they are enlarged, their legend, points and names. */
function deviationControls(box, shell, vertices, changed) {
  const control = (id) => box.querySelector(`#${id}`);
  const largest = [3, 4].map((place) => {
    let found = 0;
    for (let i = place; i < vertices.length; i += PER_VERTEX) found = Math.max(found, Math.abs(vertices[i]));
    return found;
  });
  const most = Math.max(10 * shell.exaggeration, 10);
  const chosen = () => Number(control("deviations").value === "cylinder");
  const exaggeration = () => {
    const wanted = most ** (Number(control("exaggeration").value) / 100);
    return Number(wanted.toPrecision(2));
  };
  const tell = () => {
    const limit = largest[chosen()];
    const places = decimalsOf(Math.max(1000 * limit, 0.01));
    control("factor").textContent = `× ${fixed(exaggeration(), 0)}`;
    control("least").textContent = `${fixed(-1000 * limit, places)}\u00a0mm`;
    control("most").textContent = `+${fixed(1000 * limit, places)}\u00a0mm`;
    changed();
  };
  control("exaggeration").value = (100 * Math.log(shell.exaggeration)) / Math.log(most);
  for (const id of ["deviations", "exaggeration", "show-points", "show-names"]) {
    control(id).addEventListener("input", tell);
  }
  queueMicrotask(tell);
  return {
    settings: () => ({
      exaggeration: exaggeration(), chosen: chosen(), limit: largest[chosen()] || 1,
    }),
    showPoints: () => control("show-points").checked,
    showNames: () => control("show-names").checked,
  };
}

/** Azimuths at the foot of a shell, and names of its points, as texts over the picture. */
function labelsOf(box, shell, points) {
  const layer = box.querySelector(".marks");
  const text = (content) => {
    const found = document.createElement("span");
    found.textContent = content;
    layer.append(found);
    return found;
  };
  const azimuths = shell ? [0, 90, 180, 270].map((degrees) => [degrees, text(`${degrees}°`)]) : [];
  let names = null;

  const put = (element, eye, place) => {
    const seen = projected(eye, place);
    const isSeen = seen !== null && Math.max(Math.abs(seen[0]), Math.abs(seen[1])) < 1;
    element.hidden = !isSeen;
    if (!isSeen) return;
    element.style.left = `${50 + 50 * seen[0]}%`;
    element.style.top = `${50 - 50 * seen[1]}%`;
    element.classList.toggle("behind", seen[2] > projected(eye, [0, 0, place[2]])[2]);
  };

  return {
    place(eye, { middle, scale }, settings, withNames) {
      for (const [degrees, element] of azimuths) {
        const [turn, far] = [(degrees * Math.PI) / 180, (1.15 * shell.radius_m) / scale];
        put(element, eye, [far * Math.sin(turn), far * Math.cos(turn), -middle / scale]);
      }
      if (withNames) names ??= shell.points.names.map(text);
      (names ?? []).forEach((element, i) => {
        if (!withNames) {
          element.hidden = true;
          return;
        }
        const [x, y, z, ...deviations] = points.slice(PER_VERTEX * i, PER_VERTEX * (i + 1));
        const r = shell.radius_m + settings.exaggeration * deviations[settings.chosen];
        put(element, eye, [(x * r) / scale, (y * r) / scale, (z - middle) / scale]);
      });
    },
  };
}

/** Turning and coming nearer: mouse, touch, keyboard and buttons. */
function steer(box, canvas, camera, home, changed) {
  const move = (yaw, pitch, nearer = 1) => {
    camera.yaw += yaw;
    camera.pitch = Math.max(-0.2, Math.min(1.55, camera.pitch + pitch));
    camera.distance = Math.max(0.8, Math.min(12, camera.distance / nearer));
    changed();
  };
  const moves = {
    left: () => move(-0.15, 0), right: () => move(0.15, 0), up: () => move(0, 0.1),
    down: () => move(0, -0.1), nearer: () => move(0, 0, 1.2), farther: () => move(0, 0, 1 / 1.2),
    reset: () => { Object.assign(camera, home); changed(); },
  };
  const keys = {
    ArrowLeft: "left", ArrowRight: "right", ArrowUp: "up", ArrowDown: "down",
    "+": "nearer", "=": "nearer", "-": "farther", Home: "reset",
  };
  canvas.addEventListener("keydown", (event) => {
    if (!(event.key in keys) || event.ctrlKey || event.metaKey) return;
    moves[keys[event.key]]();
    event.preventDefault();
  });
  for (const button of box.querySelectorAll("[data-move]")) {
    button.addEventListener("click", moves[button.dataset.move]);
  }
  const held = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = held.get(event.pointerId);
    if (!before) return;
    const apart = () => {
      const [one, other] = [...held.values()];
      return Math.hypot(one[0] - other[0], one[1] - other[1]);
    };
    const wasApart = held.size === 2 ? apart() : 0;
    held.set(event.pointerId, [event.clientX, event.clientY]);
    if (held.size === 2) move(0, 0, apart() / Math.max(wasApart, 1));
    else move((event.clientX - before[0]) / 150, (event.clientY - before[1]) / 150);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, (event) => held.delete(event.pointerId));
  }
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas && !event.ctrlKey) return;
    move(0, 0, Math.exp(-event.deltaY / 500));
    event.preventDefault();
  }, { passive: false });
}
