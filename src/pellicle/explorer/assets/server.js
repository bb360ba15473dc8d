// Requests of the page to its server: `call(request, body)` returns a promise of the answer.

const token = new URLSearchParams(window.location.search).get("token") ?? "";

async function call(request, body) {
  let response;
  try {
    response = await fetch(`/api/${request}`, {
      method: "POST",
      headers: { "Content-Type": "application/json", "X-Pellicle-Token": token },
      body: JSON.stringify(body),
    });
  } catch {
    throw new Error("The explorer's server does not answer: start pellicle explore again.");
  }
  const answer = await response.json().catch(() => ({}));
  if (response.ok || answer.error) return answer;
  throw new Error(response.status === 403
    ? "The server refused the request: open the address that pellicle explore printed last."
    : `The server answered with an error (${response.status}).`);
}
