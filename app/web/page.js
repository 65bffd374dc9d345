// Runs once in each page.  Everything the server asks of the page beyond viser's own messages goes through here.
(() => {
  if (window.paikka) return;

  const style = document.createElement("style");
  style.textContent = __CSS__;
  document.head.appendChild(style);

  // Labels are black on white boxes only: in the dark their text turns light and the boxes are not drawn.
  const labels = { dark: false, patched: 0 };
  const [blackText, grayText] = ["gl_FragColor = vec4(0.0, 0.0, 0.0, a);", "gl_FragColor = vec4(vec3(pkInk), a);"];
  const whiteBox = "vec4(1.0, 1.0, 1.0, 0.85 * vAlpha)";
  const gl2 = WebGL2RenderingContext.prototype;
  const { shaderSource, attachShader, useProgram, drawElementsInstanced } = gl2;
  const kinds = new WeakMap(); // program -> "text", "box" or "other"
  const inked = new WeakSet();
  let running = null;
  // Glyphs are rasterised a few per frame: all are there when frames come without another upload of the atlas.
  const drawn = { at: performance.now(), upload: performance.now(), frames: 0 };
  for (const name of ["texImage2D", "texSubImage2D"]) {
    const inner = gl2[name];
    gl2[name] = function (...rest) {
      if (!rest.includes(this.FLOAT)) Object.assign(drawn, { upload: performance.now(), frames: 0 });
      return inner.apply(this, rest);
    };
  }
  const { clear } = gl2;
  gl2.clear = function (mask) {
    drawn.at = performance.now();
    drawn.frames += 1;
    return clear.call(this, mask);
  };
  gl2.shaderSource = function (shader, source) {
    if (source.includes(blackText)) {
      source = source.replace(blackText, grayText).replace("void main()", "uniform float pkInk;\nvoid main()");
      inked.add(shader);
      labels.patched += 1;
    }
    return shaderSource.call(this, shader, source);
  };
  gl2.attachShader = function (program, shader) {
    if (inked.has(shader)) kinds.set(program, "text");
    return attachShader.call(this, program, shader);
  };
  gl2.useProgram = function (program) {
    useProgram.call(this, program);
    running = program;
    if (!program) return;
    if (!kinds.has(program)) {
      const sources = (this.getAttachedShaders(program) || []).map((s) => this.getShaderSource(s) || "");
      kinds.set(program, sources.some((s) => s.includes(whiteBox)) ? "box" : "other");
    }
    if (kinds.get(program) === "text") {
      this.uniform1f(this.getUniformLocation(program, "pkInk"), labels.dark ? 0.92 : 0.0);
    }
  };
  gl2.drawElementsInstanced = function (...rest) {
    if (labels.dark && kinds.get(running) === "box") return;
    drawElementsInstanced.apply(this, rest);
  };

  // Caption and legend lie over the canvas.
  const overlay = document.createElement("div");
  overlay.id = "pk-overlay";
  overlay.innerHTML = '<div id="pk-caption"></div><div id="pk-legend" hidden></div>';
  document.body.appendChild(overlay);
  const place = () => {
    const canvas = document.querySelector("canvas[data-engine]") || document.querySelector("canvas");
    if (!canvas) return;
    const box = canvas.getBoundingClientRect();
    Object.assign(overlay.style, {
      left: box.left + "px", top: box.top + "px", width: box.width + "px", height: box.height + "px",
    });
  };
  setInterval(place, 200);
  addEventListener("resize", place);

  // viser also turns the camera while an arrow key moves a slider or changes a tab.
  document.body.addEventListener("keydown", (event) => {
    if (event.key.startsWith("Arrow") && event.target.closest("[role=slider], [role=tab]")) event.stopPropagation();
  });

  // viser's inputs carry no accessible name; take it from the row's label.
  let hidden = []; // ids of sliders whose number field shows an exponent
  const nameInputs = () => {
    for (const id of hidden) document.getElementById(id)?.classList.add("pk-log");
    for (const label of document.querySelectorAll("label[for]")) {
      const row = label.parentElement && label.closest("div")?.parentElement;
      if (!row) continue;
      for (const input of row.querySelectorAll("[role=slider], input:not([type=hidden])")) {
        if (input.getAttribute("aria-label") !== label.textContent) input.setAttribute("aria-label", label.textContent);
      }
    }
  };
  // The line that is executed now stays in sight.
  let lastNow = "";
  const followNow = () => {
    const now = document.querySelector(".pk-now");
    const name = now?.querySelector(".pk-eq-name")?.textContent ?? "";
    if (now && name !== lastNow && now.offsetParent !== null) now.scrollIntoView({ block: "nearest" });
    lastNow = name;
  };

  // viser's advice about slow drawing lies over the caption; our Help says it instead.
  const hideAdvice = () => {
    for (const note of document.querySelectorAll("[role=alert]")) {
      if (note.textContent.startsWith("Software WebGL")) note.style.display = "none";
    }
  };

  let naming = 0;
  new MutationObserver(() => {
    followNow();
    hideAdvice();
    clearTimeout(naming);
    naming = setTimeout(nameInputs, 120);
  }).observe(document.body, { childList: true, subtree: true });

  window.paikka = {
    labels,
    search: location.search,
    // Whether what was sent before mark() is drawn; withText: labels included.
    mark: () => Object.assign(drawn, { upload: performance.now(), frames: 0 }),
    settled(withText) {
      const now = performance.now();
      if (withText && labels.patched === 0) return false;
      return now - Math.max(drawn.at, drawn.upload) > 1500 || (drawn.frames >= 8 && now - drawn.upload > 500);
    },
    setQuery(query) {
      const kept = new URLSearchParams(location.search);
      const viewer = __VIEWER__.filter((n) => kept.has(n)).map((n) => `${n}=${encodeURIComponent(kept.get(n))}`);
      history.replaceState(null, "", "?" + [query, ...viewer].join("&"));
    },
    setDark(dark) {
      labels.dark = dark;
      overlay.classList.toggle("pk-dark", dark);
    },
    setOverlay(caption, note, legend) {
      const head = document.getElementById("pk-caption");
      head.textContent = caption;
      if (note) head.appendChild(Object.assign(document.createElement("small"), { textContent: note }));
      const list = document.getElementById("pk-legend");
      list.hidden = legend.length === 0;
      list.replaceChildren(...legend.map(([color, text]) => {
        const row = document.createElement("div");
        const swatch = document.createElement("i");
        swatch.style.background = color;
        row.append(swatch, document.createTextNode(text));
        return row;
      }));
      place();
    },
    hideNumber(ids) {
      hidden = ids;
      nameInputs();
    },
    async copy(button) {
      const text = button.parentElement.querySelector("pre").textContent;
      try {
        await navigator.clipboard.writeText(text);
      } catch {
        // pages that are not served from this machine may not use the clipboard directly
        const area = Object.assign(document.createElement("textarea"), { value: text });
        document.body.append(area);
        area.select();
        document.execCommand("copy");
        area.remove();
      }
      button.textContent = "Copied";
      setTimeout(() => { button.textContent = "Copy"; }, 1500);
    },
    setTitle(title) { document.title = title; },
  };
})();
