// From the form of a tank to vertices: direction x and y, height, two deviations (m) each.
// The shader puts a vertex at direction * (radius + exaggeration * deviation).

const PER_VERTEX = 5;

/** Triangles between neighbouring rings of `around` vertices each. */
function stripsOf(rings, around) {
  const indices = [];
  for (let ring = 0; ring + 1 < rings; ring++) {
    for (let i = 0; i + 1 < around; i++) {
      const one = ring * around + i;
      indices.push(one, one + 1, one + around, one + 1, one + around + 1, one + around);
    }
  }
  return new Uint32Array(indices);
}

/** The wall of a shell, with steps at its joints: {vertices, triangles, outlines: [first, count]}. */
function shellMesh(shell) {
  const form = unpacked(shell.form, Int16Array);
  const around = shell.steps + 1;
  const vertices = [];
  const outlines = [];
  for (const course of shell.rings) {
    course.forEach(([height, section, shiftX, shiftY, ofRadius], ring) => {
      if (ring === 0 || ring === course.length - 1) {
        outlines.push([vertices.length / PER_VERTEX, around]);
      }
      for (let i = 0; i < around; i++) {
        const azimuth = (2 * Math.PI * i) / shell.steps;
        const [x, y] = [Math.sin(azimuth), Math.cos(azimuth)];
        const own = form[section * shell.steps + (i % shell.steps)] / 1e4;
        vertices.push(x, y, height, own, own + x * shiftX + y * shiftY + ofRadius);
      }
    });
  }
  const triangles = stripsOf(shell.rings.flat().length, around);
  return { vertices: new Float32Array(vertices), triangles, outlines };
}

/** The surveyed points of a shell, like the vertices of its wall. */
function pointVertices(shell) {
  const azimuths = unpacked(shell.points.azimuth_deg, Float32Array);
  const heights = unpacked(shell.points.height_m, Float32Array);
  const residuals = unpacked(shell.points.residual_m, Float32Array);
  const sections = unpacked(shell.points.section, Uint16Array);
  const rings = new Map(shell.rings.flat().map((ring) => [ring[1], ring]));
  const vertices = [];
  azimuths.forEach((degrees, i) => {
    const azimuth = (degrees * Math.PI) / 180;
    const [x, y] = [Math.sin(azimuth), Math.cos(azimuth)];
    const [, , shiftX, shiftY, ofRadius] = rings.get(sections[i]);
    vertices.push(x, y, heights[i], residuals[i],
      residuals[i] + x * shiftX + y * shiftY + ofRadius);
  });
  return new Float32Array(vertices);
}

/** The rejected points of a shell, at most so far off that they stay in the picture. */
function rejectedVertices(shell) {
  const vertices = shell.rejected.flatMap(({ azimuth, height, off_m }) => {
    const turn = (Math.PI * azimuth) / 180;
    return [Math.sin(turn), Math.cos(turn), height, off_m, off_m];
  });
  return new Float32Array(vertices);
}

/** A disc of radius 1 as a fan, for the level of the liquid; its height is set when drawn. */
function discVertices(steps = 96) {
  const vertices = [0, 0, 0, 0, 0];
  for (let i = 0; i <= steps; i++) {
    const turn = (2 * Math.PI * i) / steps;
    vertices.push(Math.sin(turn), Math.cos(turn), 0, 0, 0);
  }
  return new Float32Array(vertices);
}

/** A curve turned about its axis, upright or lying along x: {vertices, triangles, outlines}. */
function turnedMesh(solid, steps = 96) {
  const vertices = [];
  const around = steps + 1;
  for (const [along, radius] of solid.profile) {
    for (let i = 0; i < around; i++) {
      const turn = (2 * Math.PI * i) / steps;
      const [one, other] = [radius * Math.sin(turn) * solid.flat[0], radius * Math.cos(turn)];
      if (solid.upright) vertices.push(one, other, along, 0, 0);
      else vertices.push(along - solid.tilt * other, one, other + solid.tilt * along, 0, 0);
    }
  }
  const outlines = solid.profile.flatMap((_, ring) =>
    ring % 12 ? [] : [[ring * around, around]]);
  return {
    vertices: new Float32Array(vertices),
    triangles: stripsOf(solid.profile.length, around),
    outlines,
  };
}
