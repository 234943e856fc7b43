// The spectrum of a pixel as a curve, its emission lines as bars, over the colors of the wavelengths.

// About the color of a wavelength as sRGB shows it: a guide for the eye, no measure.
function hue(nm) {
  const bump = (center, left, right) => {
    const t = (nm - center) / (nm < center ? left : right);
    return Math.exp(-0.5 * t * t);
  };
  const red = 0.9 * bump(605, 38, 40) + 0.3 * bump(435, 18, 18);
  const green = bump(540, 36, 34);
  const blue = bump(452, 26, 26);
  const channel = (v) => Math.round(30 + 200 * Math.min(1, v));
  return `rgb(${channel(red)} ${channel(green)} ${channel(blue)})`;
}

function shortNumber(value) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size < 0.001 || size >= 1e7) return value.toExponential(2);
  return size < 1000 ? value.toPrecision(3) : String(Number(value.toPrecision(3)));
}

export function drawSpectrum(canvas, spectrum) {
  const scale = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  canvas.width = Math.max(1, Math.round(width * scale));
  canvas.height = Math.max(1, Math.round(height * scale));
  const context = canvas.getContext("2d");
  context.scale(scale, scale);
  context.clearRect(0, 0, width, height);
  const style = getComputedStyle(document.documentElement);
  const quiet = style.getPropertyValue("--quiet");
  const line = style.getPropertyValue("--line");
  context.font = "11px system-ui, sans-serif";
  context.fillStyle = quiet;
  if (!spectrum || spectrum.nm.length + spectrum.lines_nm.length === 0) {
    context.fillText("no spectrum is kept", 4, height / 2);
    return;
  }
  const all = spectrum.nm.concat(spectrum.lines_nm);
  const step = spectrum.nm.length > 1 ? spectrum.nm[1] - spectrum.nm[0] : 10;
  const first = Math.min(...all) - step / 2;
  const last = Math.max(...all) + step / 2;
  const bottom = height - 18;
  const top = 14;
  const x = (nm) => ((nm - first) / (last - first)) * width;
  const largest = (values) => values.reduce((a, b) => Math.max(a, b), 0);
  const most = largest(spectrum.values);
  const mostOfLines = largest(spectrum.lines);
  const y = (value, of) => bottom - (of > 0 ? Math.max(0, value / of) : 0) * (bottom - top);
  spectrum.nm.forEach((nm, i) => {
    context.fillStyle = hue(nm);
    context.globalAlpha = 0.55;
    const at = y(spectrum.values[i], most);
    context.fillRect(x(nm - step / 2), at, x(nm + step / 2) - x(nm - step / 2) + 0.5, bottom - at);
  });
  context.globalAlpha = 1;
  context.strokeStyle = style.getPropertyValue("--text");
  context.lineWidth = 1.5;
  context.beginPath();
  spectrum.nm.forEach((nm, i) => context.lineTo(x(nm), y(spectrum.values[i], most)));
  context.stroke();
  spectrum.lines_nm.forEach((nm, i) => {
    context.strokeStyle = hue(nm);
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(x(nm), bottom);
    context.lineTo(x(nm), y(spectrum.lines[i], mostOfLines));
    context.stroke();
  });
  context.strokeStyle = line;
  context.lineWidth = 1;
  context.beginPath();
  context.moveTo(0, bottom + 0.5);
  context.lineTo(width, bottom + 0.5);
  context.stroke();
  context.fillStyle = quiet;
  for (let nm = Math.ceil(first / 100) * 100; nm <= last; nm += 100) {
    const text = `${nm}`;
    const at = x(nm) - context.measureText(text).width / 2;
    context.fillText(text, Math.min(Math.max(at, 0), width - 22), height - 5);
  }
  context.fillText(`${shortNumber(most > 0 ? most : mostOfLines)}`, 2, 10);
}

// Curves along the row and the column of a pixel, over millimeters from the middle of a detector
// (pixels, where its pixels have no size).
export function drawSections(canvas, { row, column }, pitch) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = Math.max(1, Math.round(width * ratio));
  canvas.height = Math.max(1, Math.round(height * ratio));
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  const style = getComputedStyle(document.documentElement);
  const [across, down] = pitch ? pitch.map((m) => m * 1000) : [1, 1];
  const reach = Math.max(row.length * across, column.length * down) / 2;
  const most = [...row, ...column].reduce((a, b) => Math.max(a, b), 0);
  const [top, bottom] = [14, height - 18];
  const x = (mm) => ((mm / reach + 1) / 2) * width;
  const y = (value) => bottom - (most > 0 ? Math.max(0, value / most) : 0) * (bottom - top);
  for (const [values, step, color] of [[column, down, "--cool"], [row, across, "--mark"]]) {
    context.strokeStyle = style.getPropertyValue(color);
    context.lineWidth = 1.5;
    context.beginPath();
    values.forEach((value, i) => context.lineTo(x((i + 0.5 - values.length / 2) * step), y(value)));
    context.stroke();
  }
  context.strokeStyle = style.getPropertyValue("--line");
  context.lineWidth = 1;
  context.strokeRect(0, bottom + 0.5, width, 0);
  context.fillStyle = style.getPropertyValue("--quiet");
  context.font = "11px system-ui, sans-serif";
  context.fillText(shortNumber(most), 2, 10);
  const end = shortNumber(reach);
  context.fillText(`\u2212${end}`, 0, height - 5);
  context.fillText("0", width / 2 - 3, height - 5);
  context.fillText(end, width - context.measureText(end).width, height - 5);
}

export { shortNumber };
