// The service worker: after the first visit the page opens without a network.
//
// Every file but the pages is named after its content, so that one name never has two contents. A page is taken
// from the network where that answers soon, else from what was kept; it names the files of its own build, and
// files of two builds are never mixed. viscera-bundle fills in the next two lines.

const BUILD = "";
const FILES = [];

const PREFIX = `viscera ${self.registration.scope} `;
const CACHE = PREFIX + BUILD;

// How long a page may take before the kept one is shown [ms].
const PATIENCE = 4000;

self.addEventListener("install", (event) => {
  event.waitUntil(keepAll().then(() => self.skipWaiting()));
});

self.addEventListener("activate", (event) => {
  event.waitUntil(forgetOld().then(() => self.clients.claim()));
});

self.addEventListener("fetch", (event) => {
  const { request } = event;
  const isOwn = request.url.startsWith(self.registration.scope);
  if (request.method !== "GET" || !isOwn || request.headers.has("range")) return;
  event.respondWith(isNamedAfterContent(request.url) ? lasting(request) : changing(request));
});

// Keeps the whole build, or nothing: without one of the files the next visit tries again.
async function keepAll() {
  if (BUILD === "") return;
  try {
    const cache = await caches.open(CACHE);
    await Promise.all(FILES.map((name) => keep(cache, name)));
  } catch (error) {
    await caches.delete(CACHE);
    throw error;
  }
}

async function keep(cache, name) {
  const url = new URL(name, self.registration.scope);
  const kept = await caches.match(url);
  const isPage = name.endsWith(".html");
  if (kept && isNamedAfterContent(name)) {
    await cache.put(url, kept);
    return;
  }
  // What keeps its name is asked for anew, whatever the browser has of it.
  const response = await fetch(url, { cache: isNamedAfterContent(name) ? "default" : "no-cache" });
  if (!response.ok) throw new Error(`${name}: the server answers ${response.status}`);
  const content = await response.arrayBuffer();
  if (isPage && !new TextDecoder().decode(content).includes(`content="${BUILD}"`)) {
    throw new Error(`${name} is of another build; the next visit tries again`);
  }
  // A copy, since a browser opens no page that came by a redirection.
  const headers = new Headers({ "Content-Type": response.headers.get("Content-Type") ?? "" });
  await cache.put(url, new Response(content, { headers }));
}

function isNamedAfterContent(address) {
  return /\.[0-9a-f]{16}\.[^./]+$/.test(address);
}

// One older build stays: a page of it may still be open in another tab.
async function forgetOld() {
  const own = (await caches.keys()).filter((name) => name.startsWith(PREFIX) && name !== CACHE);
  await Promise.all(own.slice(0, -1).map((name) => caches.delete(name)));
}

// Of whichever build: one name has one content.
async function lasting(request) {
  return (await caches.match(request)) ?? fetch(request);
}

// What keeps its name: from the network where that answers soon.
async function changing(request) {
  const kept = await keptByName(request);
  if (!kept) return fetch(request);
  const ended = new AbortController();
  const timer = setTimeout(() => ended.abort(), PATIENCE);
  try {
    const response = await fetch(request, { signal: ended.signal });
    // A server in trouble; what was kept is better.
    return response.ok || response.type === "opaqueredirect" ? response : kept;
  } catch {
    return kept;
  } finally {
    clearTimeout(timer);
  }
}

// Whatever follows `?`: the page reads that by itself.
async function keptByName(request) {
  const url = new URL(request.url);
  url.search = "";
  url.hash = "";
  if (url.pathname.endsWith("/")) url.pathname += "index.html";
  const cache = await caches.open(CACHE);
  return cache.match(url);
}
