// Matrices of four columns, as WebGL takes them (column by column).

function product(a, b) {
  const found = new Float32Array(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      let sum = 0;
      for (let i = 0; i < 4; i++) sum += a[4 * i + row] * b[4 * column + i];
      found[4 * column + row] = sum;
    }
  }
  return found;
}

/** Perspective with a field of view (rad, upwards) and a ratio of width to height. */
function perspective(angle, ratio, near, far) {
  const size = 1 / Math.tan(angle / 2);
  return new Float32Array([size / ratio, 0, 0, 0, 0, size, 0, 0,
    0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0]);
}

/** Seen from a distance around the origin; z is up, yaw and pitch in rad. */
function orbit(yaw, pitch, distance) {
  const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  return new Float32Array([cy, sy * sp, -sy * cp, 0, -sy, cy * sp, -cy * cp, 0,
    0, cp, sp, 0, 0, 0, -distance, 1]);
}

/** Where a point comes to stand: x and y from -1 to 1, null behind the eye. */
function projected(matrix, [x, y, z]) {
  const row = (i) => matrix[i] * x + matrix[4 + i] * y + matrix[8 + i] * z + matrix[12 + i];
  const w = row(3);
  return w > 0 ? [row(0) / w, row(1) / w, row(2) / w] : null;
}
