// SPDX-License-Identifier: Apache-2.0
// The live image: floats to false colour on the graphics processor, with probes drawn over it.

import { Frame } from "./link.js";
import { PROBE_COLORS } from "./colors.js";

const VERTEX = `#version 300 es
out vec2 uv;
void main() {
  vec2 corner = vec2(float((gl_VertexID << 1) & 2), float(gl_VertexID & 2));
  uv = vec2(corner.x, 1.0 - corner.y);
  gl_Position = vec4(corner * 2.0 - 1.0, 0.0, 1.0);
}`;

// The colour of a value is the number of bounds below it: 255 of them, found by halving. So limits
// in kelvins need no conversion of pixels, but of the bounds.
const FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
in vec2 uv;
out vec4 color;
uniform sampler2D pixels;
uniform sampler2D bounds;
uniform sampler2D colors;
uniform vec4 nan_color;
void main() {
  ivec2 size = textureSize(pixels, 0);
  ivec2 at = clamp(ivec2(uv * vec2(size)), ivec2(0), size - 1);
  float value = texelFetch(pixels, at, 0).r;
  if (isnan(value)) {
    color = nan_color;
    return;
  }
  int low = 0;
  for (int step = 128; step > 0; step >>= 1) {
    if (low + step <= 255 && texelFetch(bounds, ivec2(low + step - 1, 0), 0).r <= value) low += step;
  }
  color = texelFetch(colors, ivec2(low, 0), 0);
}`;

export interface Point {
  x: number;
  y: number;
}

export class ImageView {
  private readonly gl: WebGL2RenderingContext;
  private readonly overlay: CanvasRenderingContext2D;
  private readonly textures: WebGLTexture[] = [];
  private readonly nanColor: WebGLUniformLocation | null;
  frame: Frame | null = null;
  /** Shows black instead of the frame. */
  blank = false;
  private width = 0;
  private height = 0;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly overlayCanvas: HTMLCanvasElement,
  ) {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, preserveDrawingBuffer: true });
    const overlay = overlayCanvas.getContext("2d");
    if (gl === null || overlay === null) throw new Error("this browser has no WebGL2");
    this.gl = gl;
    this.overlay = overlay;
    const program = gl.createProgram() as WebGLProgram;
    for (const [stage, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]] as const) {
      const shader = gl.createShader(stage) as WebGLShader;
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader) ?? "shader");
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    ["pixels", "bounds", "colors"].forEach((name, unit) => {
      const texture = gl.createTexture() as WebGLTexture;
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      for (const key of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
        gl.texParameteri(gl.TEXTURE_2D, key, gl.NEAREST);
      }
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
      gl.uniform1i(gl.getUniformLocation(program, name), unit);
      this.textures.push(texture);
    });
    this.nanColor = gl.getUniformLocation(program, "nan_color");
  }

  setColors(table: Uint8Array, nan: string): void {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE2);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, table);
    const part = (at: number) => parseInt(nan.substr(at, 2), 16) / 255;
    gl.uniform4f(this.nanColor, part(0), part(2), part(4), 1);
  }

  /** Sets the 255 values between two colours each, ascending. */
  setBounds(bounds: Float32Array): void {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE1);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, 255, 1, 0, gl.RED, gl.FLOAT, bounds);
  }

  setFrame(frame: Frame): void {
    const gl = this.gl;
    gl.activeTexture(gl.TEXTURE0);
    if (frame.width_px === this.width && frame.height_px === this.height) {
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, this.width, this.height, gl.RED, gl.FLOAT, frame.pixels);
    } else {
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, frame.width_px, frame.height_px, 0, gl.RED, gl.FLOAT, frame.pixels);
      this.width = frame.width_px;
      this.height = frame.height_px;
      this.layout();
    }
    this.frame = frame;
  }

  /** Gives both canvases the largest size of the image's shape that the box has room for. */
  layout(): void {
    const box = this.canvas.parentElement as HTMLElement;
    if (this.width === 0) return;
    const scale = Math.min(box.clientWidth / this.width, box.clientHeight / this.height);
    const width = Math.max(1, Math.floor(this.width * scale));
    const height = Math.max(1, Math.floor(this.height * scale));
    const ratio = window.devicePixelRatio || 1;
    for (const canvas of [this.canvas, this.overlayCanvas]) {
      canvas.style.width = `${width}px`;
      canvas.style.height = `${height}px`;
      canvas.style.left = `${Math.floor((box.clientWidth - width) / 2)}px`;
      canvas.style.top = `${Math.floor((box.clientHeight - height) / 2)}px`;
    }
    // The image has one sample a pixel, whatever the screen's size: the browser makes it larger.
    this.canvas.width = this.width;
    this.canvas.height = this.height;
    this.overlayCanvas.width = Math.round(width * ratio);
    this.overlayCanvas.height = Math.round(height * ratio);
  }

  draw(): void {
    const gl = this.gl;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    if (this.frame === null || this.blank) {
      gl.clearColor(0, 0, 0, 1);
      gl.clear(gl.COLOR_BUFFER_BIT);
      return;
    }
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** Returns the pixel under a place of the window; null outside the image. */
  pixelAt(clientX: number, clientY: number): Point | null {
    const box = this.overlayCanvas.getBoundingClientRect();
    if (this.width === 0 || box.width === 0) return null;
    const x = Math.floor(((clientX - box.left) / box.width) * this.width);
    const y = Math.floor(((clientY - box.top) / box.height) * this.height);
    return x >= 0 && y >= 0 && x < this.width && y < this.height ? { x, y } : null;
  }

  value(point: Point): number {
    const frame = this.frame;
    if (frame === null || point.x >= frame.width_px || point.y >= frame.height_px) return NaN;
    return frame.pixels[point.y * frame.width_px + point.x];
  }

  get size(): Point {
    return { x: this.width, y: this.height };
  }

  drawOverlay(probes: readonly (Point | null)[], cursor: Point | null): void {
    const context = this.overlay;
    const { width, height } = this.overlayCanvas;
    const ratio = window.devicePixelRatio || 1;
    context.clearRect(0, 0, width, height);
    if (this.width === 0) return;
    const place = (point: Point): Point => ({
      x: ((point.x + 0.5) / this.width) * width,
      y: ((point.y + 0.5) / this.height) * height,
    });
    const cross = (at: Point, inner: number, outer: number, color: string, line: number) => {
      for (const [style, wide] of [["rgba(0,0,0,0.75)", line + 2], [color, line]] as const) {
        context.strokeStyle = style;
        context.lineWidth = wide * ratio;
        context.beginPath();
        for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
          context.moveTo(at.x + dx * inner * ratio, at.y + dy * inner * ratio);
          context.lineTo(at.x + dx * outer * ratio, at.y + dy * outer * ratio);
        }
        context.stroke();
      }
    };
    context.font = `600 ${12 * ratio}px "DejaVu Sans", sans-serif`;
    probes.forEach((probe, i) => {
      if (probe === null) return;
      const at = place(probe);
      cross(at, 3, 9, PROBE_COLORS[i], 1.5);
      context.lineWidth = 3 * ratio;
      context.strokeStyle = "rgba(0,0,0,0.75)";
      context.strokeText(String(i + 1), at.x + 8 * ratio, at.y - 6 * ratio);
      context.fillStyle = PROBE_COLORS[i];
      context.fillText(String(i + 1), at.x + 8 * ratio, at.y - 6 * ratio);
    });
    if (cursor !== null) cross(place(cursor), 4, 14, "#e8eef4", 1);
  }
}

/** Returns the values at two percentiles, of at most some ten thousand pixels; null: none is finite. */
export function percentiles(pixels: Float32Array, low: number, high: number): [number, number] | null {
  const step = Math.max(1, Math.floor(pixels.length / 40000));
  const sample = new Float32Array(Math.ceil(pixels.length / step));
  let count = 0;
  for (let i = 0; i < pixels.length; i += step) {
    if (Number.isFinite(pixels[i])) sample[count++] = pixels[i];
  }
  if (count === 0) return null;
  const sorted = sample.subarray(0, count).sort();
  const at = (percent: number) => sorted[Math.round((percent / 100) * (count - 1))];
  return [at(low), at(high)];
}
