// Fetches a model stream and tells, piece by piece, what has arrived.
import { StreamDecoder, StreamError } from "./stream";

export type StreamRequest = Pick<RequestInit, "headers" | "cache">;

export interface LoadOptions {
  readonly url: string;
  readonly expectedBytes: number | null;
  readonly signal: AbortSignal;
  /** What the request must carry beyond the site's own cookies, and how it is cached. */
  readonly request?: StreamRequest;
  /** Called after every piece; the decoder's arrays hold all that is ready. */
  readonly onProgress: (decoder: StreamDecoder) => void;
}

export async function loadStream(options: LoadOptions): Promise<StreamDecoder> {
  const { url, signal, request } = options;
  const response = await fetch(url, { ...request, signal, credentials: "same-origin" });
  if (!response.ok || response.body === null) throw new StreamError(`answer ${response.status}`);
  const decoder = new StreamDecoder(options.expectedBytes);
  const reader = response.body.getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      decoder.push(value);
      options.onProgress(decoder);
    }
    decoder.finish();
  } catch (error) {
    await reader.cancel().catch(() => undefined);
    throw error;
  }
  return decoder;
}
