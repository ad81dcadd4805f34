// Drawing with WebGL 2: a surface coloured by its deviations, its lines and points.

const VERTEX = `#version 300 es
layout(location = 0) in vec3 place;
layout(location = 1) in vec2 deviations;
uniform mat4 eye;
uniform highp float radius, exaggeration, chosen, lift, middle, scale, wide, nearer;
out vec3 at;
out float deviation;
void main() {
  deviation = mix(deviations.x, deviations.y, chosen);
  at = vec3(place.xy * (radius + exaggeration * deviation), place.z + lift - middle) / scale;
  gl_Position = eye * vec4(at, 1.0);
  gl_Position.z -= nearer * gl_Position.w;
  gl_PointSize = wide;
}`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 at;
in float deviation;
uniform highp float limit, lit, wide;
uniform vec4 colour;
out vec4 seen;
vec3 ramp(float t) {
  vec3 blue = vec3(0.129, 0.400, 0.675), white = vec3(0.969), red = vec3(0.698, 0.094, 0.169);
  vec3 pale = t < 0.0 ? vec3(0.573, 0.773, 0.871) : vec3(0.957, 0.647, 0.510);
  float size = min(abs(t), 1.0);
  vec3 end = t < 0.0 ? blue : red;
  return size < 0.5 ? mix(white, pale, 2.0 * size) : mix(pale, end, 2.0 * size - 1.0);
}
void main() {
  if (wide > 1.0 && length(gl_PointCoord - 0.5) > 0.5) discard;
  vec3 own = limit > 0.0 ? ramp(deviation / limit) : colour.rgb;
  float light = 1.0;
  if (lit > 0.0) {
    vec3 normal = normalize(cross(dFdx(at), dFdy(at)));
    light = 0.72 + 0.28 * abs(dot(normal, normalize(vec3(0.3, -0.7, 0.65))));
  }
  seen = vec4(own * light, colour.a);
}`;

function compiled(gl) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
    throw new Error(gl.getProgramInfoLog(program));
  }
  return program;
}

/** A scene on a canvas, or null where the browser has no WebGL 2. */
function sceneOn(canvas) {
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: true });
  if (!gl) return null;
  const program = compiled(gl);
  const places = new Map();
  const uniform = (name) => {
    if (!places.has(name)) places.set(name, gl.getUniformLocation(program, name));
    return places.get(name);
  };

  const uploaded = (vertices, triangles = null) => {
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, vertices, gl.STATIC_DRAW);
    const stride = 4 * PER_VERTEX;
    for (const [location, size, offset] of [[0, 3, 0], [1, 2, 12]]) {
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, size, gl.FLOAT, false, stride, offset);
    }
    if (triangles) {
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
    }
    gl.bindVertexArray(null);
    return { array, count: triangles ? triangles.length : vertices.length / PER_VERTEX };
  };

  /** Draw a part: its mode, its settings (uniforms of one number), its colour [r, g, b, a]. */
  const draw = (part, mode, settings, colour, pieces = null) => {
    for (const [name, value] of Object.entries(settings)) gl.uniform1f(uniform(name), value);
    gl.uniform4fv(uniform("colour"), colour);
    gl.bindVertexArray(part.array);
    if (mode === gl.TRIANGLES) gl.drawElements(mode, part.count, gl.UNSIGNED_INT, 0);
    else for (const [first, count] of pieces ?? [[0, part.count]]) gl.drawArrays(mode, first, count);
  };

  const begin = (eye) => {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [canvas.clientWidth * ratio, canvas.clientHeight * ratio];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.useProgram(program);
    gl.uniformMatrix4fv(uniform("eye"), false, eye);
  };
  return { gl, uploaded, draw, begin };
}
